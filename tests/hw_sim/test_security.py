"""What a stranger sends to the emulated sensor is not believed: forged, recorded, thrown back or noise."""

from __future__ import annotations

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from tests.hw_sim.tiny_box import KEY, TinyBox, hello_times, paired, readings

STRANGER = SensorKey("left-wrist", KEY.device_id, bytes(16))


class TestWhomItBelieves:
    """Assignments and heartbeats that are forged, replayed or damaged change nothing."""

    def test_another_key(self) -> None:
        pair = paired(box=TinyBox(STRANGER))
        pair.box.boot_nonce = pair.device.boot_nonce
        pair.box.answers = False
        for hello in range(4):
            pair.line.inject(pair.box.assignment(hello))
            pair.run(0.5)
        assert pair.device.light == "looking"

    def test_an_assignment_for_another_power_on(self) -> None:
        pair = paired()
        pair.run(1.0)
        recorded = pair.box.assignment(0)
        pair.box.answers = False
        pair.device.switch_off(pair.clock.now, 0.1)
        for _ in range(4):
            pair.run(0.5)
            pair.line.inject(recorded)
        assert pair.device.light == "looking"

    def test_an_assignment_to_session_zero_or_to_a_hello_never_said(self) -> None:
        pair = paired()
        pair.box.answers = False
        pair.run(0.1)
        pair.box.boot_nonce = pair.device.boot_nonce
        pair.line.inject(pair.box.assignment(0, session=0))
        pair.line.inject(pair.box.assignment(1))
        pair.run(0.1)
        assert pair.device.light == "looking"
        pair.line.inject(pair.box.assignment(0))
        pair.run(0.1)
        assert pair.device.light == "on"

    def test_an_assignment_is_followed_once(self) -> None:
        pair = paired()
        pair.run(1.0)
        recorded = pair.box.assignment(0)
        pair.box.answers = False
        for _ in range(10):
            pair.line.inject(recorded)
            pair.run(0.4)
        assert pair.device.light == "looking"

    def test_an_assignment_to_one_of_the_last_four_hellos_counts_and_an_older_one_does_not(self) -> None:
        for answered, light in ((6, "on"), (3, "on"), (2, "looking")):
            pair = paired()
            pair.box.answers = False
            pair.run(3.2)  # hellos 0 to 6
            pair.box.boot_nonce = pair.device.boot_nonce
            pair.line.inject(pair.box.assignment(answered))
            pair.run(0.1)
            assert pair.device.light == light, answered

    def test_a_recorded_heartbeat_keeps_no_link(self) -> None:
        pair = paired()
        pair.run(2.0)
        recorded = pair.box.sign(wire.Heartbeat(*pair.box.head(), 0, 0, wire.LED_ON))
        pair.line.inject(recorded)
        pair.run(0.1)
        pair.box.answers = False
        for _ in range(10):
            pair.line.inject(recorded)
            pair.run(0.4)
        assert pair.device.light == "looking"

    def test_a_heartbeat_of_another_session(self) -> None:
        pair = paired()
        pair.run(2.0)
        pair.line.inject(pair.box.sign(wire.Heartbeat(*pair.box.head(0xBAD), 0, 0, wire.LED_FAST)))
        pair.run(0.01)
        assert pair.device.light == "on"

    def test_its_own_packets_thrown_back_and_noise(self) -> None:
        pair = paired()
        pair.line.passing_on = pair.line.inject
        pair.run(3.0)
        for noise in (b"", b"\0" * 35, bytes(range(66))):
            pair.line.inject(noise)
        pair.run(1.0)
        assert len(readings(pair)) == pytest.approx(165, abs=2)
        assert len(hello_times(pair)) == 1
