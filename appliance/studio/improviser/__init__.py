"""The improviser: moves that a network makes up, and endless phrases made of them."""
