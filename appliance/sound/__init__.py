"""Sound, a process of its own: the shared frame in, strings that the dance plays out."""
