"""The adversarial autoencoder: networks, losses, and the training loop."""
