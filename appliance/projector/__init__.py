"""The projector process: the shared frame in, pixels out."""
