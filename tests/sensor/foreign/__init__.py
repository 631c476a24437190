"""Foreign sensors."""
