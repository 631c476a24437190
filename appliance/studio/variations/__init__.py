"""Variations of a phrase by the sequence autoencoder of 'Beyond Imitation'."""
