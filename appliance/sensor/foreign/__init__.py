"""Foreign sensors: phones and programs in place of wearables, by the same wire over the box's own network."""
