"""Release: which show and which version start."""
