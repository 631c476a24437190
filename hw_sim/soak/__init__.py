"""Soak: an evening, or a week, of load and trouble for the whole box; does it stay as even and as small?"""
