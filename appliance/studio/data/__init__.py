"""Recordings as training data: facts about them, masks, and held-out takes."""
