"""DMX: universes and the wires that carry them (Art-Net, sACN, USB)."""
