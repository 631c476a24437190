"""The page for technicians: a process of its own, which browsers at the venue open."""
