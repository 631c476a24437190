"""The studio (workstation only): data, networks, training, export and experiments."""
