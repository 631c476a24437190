"""The projector, a process of its own: the shared frame in, pixels out."""
