"""Recordings as training data: what is known of them, what is masked, what is held out."""
