"""Looks: ways of drawing the dancer, one module each."""
