"""Authentic packets late, twice, never or from elsewhere: nothing raises and no power-on comes back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from appliance.sensor import wire
from tests.sensor.peers import KEYS, STRANGER, A, B, Box, Wearable


class Air:
    """A sensor and a box with a storm between them: packets come late, twice, never, or from elsewhere."""

    def __init__(self) -> None:
        self.box = Box()
        self.boots = 1
        self.sensor = Wearable(KEYS["left-wrist"], self.boots)
        self.to_box: list[bytes] = []
        self.to_sensor: list[bytes] = []
        self.newest: dict[int, int] = {}
        self.order: list[int] = []

    def say(self, make: Callable[[Wearable], bytes]) -> None:
        self.to_box.append(make(self.sensor))

    def carry(self, which: int, origin: tuple[str, int]) -> None:
        if not self.to_box:
            return
        for reading in self.box.hear(self.to_box[-1 - which % len(self.to_box)], origin=origin):
            assert reading.sequence > self.newest.get(reading.boot_nonce, 0)
            self.newest[reading.boot_nonce] = reading.sequence
            if reading.boot_nonce not in self.order:
                self.order.append(reading.boot_nonce)
            assert reading.boot_nonce == self.order[-1]  # a power-on that another has followed stays gone
        self.to_sensor += [data for data, _ in self.box.answers()]

    def answer(self, which: int) -> None:
        if not self.to_sensor:
            return
        packet = wire.unpack(self.to_sensor[-1 - which % len(self.to_sensor)], lambda _: self.sensor.tagger)
        if isinstance(packet, wire.Assignment) and packet.boot_nonce == self.sensor.boot:
            self.sensor.session = packet.session

    def restart_sensor(self) -> None:
        self.boots += 1
        self.sensor = Wearable(KEYS["left-wrist"], self.boots)


recent = st.one_of(st.integers(0, 2), st.integers(0, 100))
makes = st.sampled_from([Wearable.hello, Wearable.reading, Wearable.reading, Wearable.profile])
steps = st.one_of(
    st.tuples(st.just("say"), makes, st.booleans()),
    st.tuples(st.just("carry"), recent, st.sampled_from([A, B, STRANGER])),
    st.tuples(st.just("answer"), recent),
    st.tuples(st.just("pair")),
    st.tuples(st.just("reboot")),
    st.tuples(st.just("wait"), st.sampled_from([0.02, 0.15, 0.6, 4.0])),
)


@settings(
    max_examples=200, suppress_health_check=[HealthCheck.large_base_example, HealthCheck.data_too_large]
)
@given(st.lists(steps, min_size=40, max_size=100))
def test_authentic_packets_in_any_order_never_raise_and_never_go_back(script: list[tuple[Any, ...]]) -> None:
    air = Air()
    for what, *arguments in script:
        match what:
            case "say":
                make, arrives = arguments
                air.say(make)
                if arrives:
                    air.carry(0, A)
            case "pair":
                air.box.now += 0.2
                air.say(Wearable.hello)
                air.carry(0, A)
                air.answer(0)
            case "carry":
                air.carry(*arguments)
            case "answer":
                air.answer(*arguments)
            case "reboot":
                air.restart_sensor()
            case "wait":
                air.box.now += arguments[0]
                air.to_sensor += [data for data, _ in air.box.answers()]
        air.box.link.states(air.box.now)
