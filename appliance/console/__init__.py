"""The page for technicians: a separate process, which browsers at the venue open."""
