"""Granular Dance: motion out of the autoencoder's latents alone ('Puppeteering an AI', section 3.1)."""
