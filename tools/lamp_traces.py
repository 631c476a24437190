"""The lamp of a wearable in each state: traces of the compiled firmware in its simulated world."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim.firmware import BOX, NETWORK, PASSWORD, provision
from hw_sim.firmware_library import CompiledWearable, State

SHOWN_S = 8.0
SETTLE_S = 8.0  # joined, greeted, linked, and any blocking call is over
JUST_BEGUN_S = 0.02  # what lights up only at the very end is left out
TURN_US = 2_000
HEARTBEAT_EVERY_US = 1_000_000
SESSION = 0xB0B0B0
FULL_MV, LOW_MV = 4100, 3650
KEY = SensorKey("lamp", 1, bytes(range(1, 17)))

Trace = list[tuple[float, float]]  # when the lamp went on and off, seconds in 0..SHOWN_S


def traces() -> dict[str, Trace]:
    """By name of the state. Raises FirmwareMissingError when the firmware was not compiled."""
    flash = provision(KEY)
    shown = {}
    with _wearable(None) as wearable:
        shown["unprovisioned"] = _watched(wearable)
    with _wearable(flash) as wearable:
        wearable.set_access_point(False, 0)
        shown["joining"] = _watched(wearable)
    for name, led in (("linked", wire.LED_ON), ("neutral", wire.LED_SLOW), ("strobe", wire.LED_STROBE)):
        with _wearable(flash) as wearable:
            shown[name] = _watched(wearable, led)
            assert wearable.status.state == State.LINKED
    with _wearable(flash, LOW_MV) as wearable:
        shown["battery"] = _watched(wearable, wire.LED_ON)
    with _wearable(flash) as wearable:
        wearable.set_trouble("nack", 1.0)
        shown["no imu"] = _watched(wearable, wire.LED_ON)
    return shown


@contextmanager
def _wearable(flash: bytes | None, battery_mv: int = FULL_MV) -> Iterator[CompiledWearable]:
    """A wearable that was just switched on, in reach of its network."""
    wearable = CompiledWearable(flash)
    try:
        wearable.set_network(NETWORK, PASSWORD)
        wearable.set_access_point(True, 0)
        wearable.set_battery(battery_mv)
        wearable.power(True)
        yield wearable
    finally:
        wearable.close()


def _watched(wearable: CompiledWearable, led: int | None = None) -> Trace:
    """Its lamp once it has settled, starting with a flash; `led`: what the box asks for."""
    box = None if led is None else _Box(led)
    changes: list[tuple[int, bool]] = []
    now_us, end_us = 0, round((SETTLE_S + 2 * SHOWN_S) * 1e6)
    while now_us < end_us:
        now_us = wearable.step_until(now_us + TURN_US)
        changes += wearable.take_light()
        if box is not None:
            for packet in box.answers([sent.data for sent in wearable.take_datagrams()], now_us):
                wearable.put_datagram(BOX, packet)
    return _from_a_lit_moment(changes)


class _Box:
    """Enough of a box to keep one wearable linked: answers every hello, sends a heartbeat each second."""

    def __init__(self, led: int) -> None:
        self._led = led
        self._tagger = wire.Tagger(KEY.key)
        self._sequence = 0
        self._heard: wire.Reading | None = None
        self._next_us = 0

    def answers(self, packets: Iterable[bytes], now_us: int) -> list[bytes]:
        answers = []
        for data in packets:
            packet = wire.unpack(data, lambda _: self._tagger)
            if isinstance(packet, wire.Hello):
                head = (KEY.device_id, packet.boot_nonce, SESSION, self._count())
                answers.append(
                    wire.pack(wire.Assignment(*head, packet.sequence, 0, 50, self._led), self._tagger)
                )
            elif isinstance(packet, wire.Reading):
                self._heard = packet
        if self._heard is not None and now_us >= self._next_us:
            self._next_us = now_us + HEARTBEAT_EVERY_US
            head = (KEY.device_id, self._heard.boot_nonce, SESSION, self._count())
            beat = wire.Heartbeat(*head, self._heard.sequence, 0, self._led)
            answers.append(wire.pack(beat, self._tagger))
        return answers

    def _count(self) -> int:
        self._sequence += 1
        return self._sequence


def _from_a_lit_moment(changes: list[tuple[int, bool]]) -> Trace:
    """SHOWN_S of them from the start of the first group of flashes after SETTLE_S."""
    lit: Trace = []
    for at_us, is_on in changes:
        if is_on:
            lit.append((at_us * 1e-6, float("inf")))
        elif lit:
            lit[-1] = (lit[-1][0], at_us * 1e-6)
    settled = [span for span in lit if span[0] >= SETTLE_S]
    pauses = [begun - before[1] for before, (begun, _) in zip([(0.0, 0.0), *settled], settled, strict=False)]
    longest = max(pauses[1:], default=0.0)
    first = next(i for i, pause in enumerate(pauses) if i and pause > longest - 0.01)
    start = settled[first][0]
    return [
        (begun - start, min(ended - start, SHOWN_S))
        for begun, ended in settled
        if 0 <= begun - start < SHOWN_S - JUST_BEGUN_S
    ]
