"""The sound process: the shared frame in, strings that the dance plays out."""
