"""Soak: hours of load and faults for the whole box; its timing and memory must stay the same."""
