"""Peers for the box: emulated sensors, a venue network, receivers and the latency probe."""
