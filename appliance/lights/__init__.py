"""The lights process: the shared frame in, fixtures and their universes out."""
