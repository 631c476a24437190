"""How packets travel: by network or cable."""
