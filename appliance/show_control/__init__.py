"""Show control: what the show should be, and the answers to questions about it."""
