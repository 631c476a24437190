"""Worn sensors: the wire, its links, and what the box believes of a reading."""
