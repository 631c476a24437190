"""Keeper: the process that carries things to the disk."""
