"""Feedback: where each lever stands, at its own address, for motor faders and lit buttons."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence

from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, LEVERS, find_lever
from appliance.show_control.listeners import Listeners
from appliance.show_control.packet import Message
from appliance.show_control.settings import Listener

AGAIN_S = 10.0  # all of them, for a controller that was switched on since


class Feedback:
    """Sends a lever once it is declared anew, to all listeners but the one that has moved it.

    One message a datagram: some controllers read only the first one of a bundle.
    """

    def __init__(self, listeners: Sequence[Listener], now: float) -> None:
        self._listeners = [Listeners([one]) for one in listeners]
        self._hosts = list(listeners)
        self._due = [now] * len(listeners)
        self._state: ShowState | None = None
        self._reported: dict[Message, Message] = {}

    def look(self, state: ShowState, now: float, mover: Listener | None = None) -> None:
        """Call it after each command, with its sender, and often besides."""
        if not self._hosts:
            return
        changed: list[Message] = []
        if state is not self._state:
            self._state = state
            reported = {_key(one): one for one in messages_of(state)}
            changed = [one for key, one in reported.items() if self._reported.get(key) != one]
            self._reported = reported
        for place, (listener, host) in enumerate(zip(self._listeners, self._hosts, strict=True)):
            if changed and mover is not None and _is_same(host, mover):
                self._due[place] = now + AGAIN_S  # a fader under a finger is left alone
            elif now >= self._due[place]:
                self._due[place] = now + AGAIN_S
                self._send(listener, [*self._reported.values()])
            else:
                self._send(listener, changed)

    def close(self) -> None:
        for one in self._listeners:
            one.close()

    def _send(self, listener: Listeners, messages: Sequence[Message]) -> None:
        for one in messages:
            listener.send(one)


def messages_of(state: ShowState) -> Iterator[Message]:
    """Every lever that has an address and was set, in the form of its command, without the fade.

    Of those that nobody has set only what no show sets: the master and its like.
    """
    yield "/panic", int(state.panic)
    yield "/blackout", int(state.blackout)
    yield "/go", int(state.going)
    names = dict.fromkeys((*(one.name for one in LEVERS if one.stays), *state.settings))
    for lever in filter(None, map(find_lever, names)):
        address = "/cue" if lever is CUE else lever.address
        text, numbers = lever.kind.formatted(state[lever].value)
        text = text or lever.none
        least = len(lever.kind.numbers) - lever.kind.optional
        if address and bool(text) == bool(lever.kind.text) and len(numbers) >= max(least, not text):
            yield (address, *([text] if text else []), *numbers)


def _key(message: Message) -> Message:
    """The lever that a message tells of: hands have one address, and each its joint."""
    return message[:2] if message[0] == "/hold" else message[:1]


def _is_same(listener: Listener, mover: Listener) -> bool:
    """Whether a command came from there. Programs send from another port than they listen on; on this
    machine that may be another program.
    """
    if ipaddress.ip_address(mover[0]).is_loopback:
        return listener == mover
    return listener[0] == mover[0]
