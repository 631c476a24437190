"""Blind pairs: a page on which people choose between two dances, and what their votes prove."""
