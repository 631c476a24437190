"""Once, by cable: a wearable gets its name, its network and its key."""
