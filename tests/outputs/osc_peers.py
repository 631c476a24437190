"""What tests of OSC receivers need on this machine: messages as they come."""

from __future__ import annotations

from hw_sim.osc_receiver import OscReceiver, Received

LOOPBACK = "127.0.0.1"


def take(peer: OscReceiver, count: int) -> list[Received]:
    """The next `count` messages."""
    messages: list[Received] = []
    while len(messages) < count:
        new = peer.poll(timeout=5.0)
        assert new, f"only {len(messages)} of {count} messages came"
        messages += new
    return messages
