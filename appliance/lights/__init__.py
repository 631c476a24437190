"""Lights, a process of its own: the shared frame in, fixtures and their universes out."""
