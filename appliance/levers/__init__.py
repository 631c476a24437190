"""Levers: what a desk, a cue or the page may set, described once."""
