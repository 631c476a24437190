"""Granular Dance: motion from only the autoencoder's latents ('Puppeteering an AI', section 3.1)."""
