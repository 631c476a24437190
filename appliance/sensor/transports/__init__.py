"""The ways by which packets come and go: the network, a cable."""
