"""The calibration that the emulated sensor saves, tells the box and takes back from it."""

from __future__ import annotations

import pytest

from appliance.sensor import wire
from tests.hw_sim.tiny_box import Pair, paired, readings


class TestCalibration:
    """The box keeps what the sensor saved, and gives it back to a sensor that has none."""

    OFFSETS = bytes(range(22))

    def restore(self, pair: Pair, imu_id: bytes) -> bytes:
        return pair.box.sign(wire.Restore(*pair.box.head(), imu_id, self.OFFSETS))

    def test_told_three_times_a_second_apart(self) -> None:
        pair = paired()
        pair.device.save_profile(self.OFFSETS, pair.clock.now)
        pair.run(5.0)
        reported = pair.box.of(wire.Profile)
        assert [packet.sequence for _, packet in reported] == [0, 1, 2]
        assert reported[2][0] - reported[0][0] == pytest.approx(2.0, abs=0.1)
        assert readings(pair)[-1].flags & wire.HAS_PROFILE

    def test_taken_after_the_assignment(self) -> None:
        pair = paired()
        pair.run(1.0)
        assert not readings(pair)[-1].flags & wire.HAS_PROFILE
        pair.line.inject(self.restore(pair, pair.device.imu_id))
        pair.run(0.1)
        assert pair.device.profile == self.OFFSETS
        assert readings(pair)[-1].flags & wire.HAS_PROFILE

    def test_not_in_another_session_and_not_a_recorded_one(self) -> None:
        """As the firmware: it counts both as replayed."""
        pair = paired()
        pair.run(1.0)
        head = pair.box.head(0xBAD)
        pair.line.inject(pair.box.sign(wire.Restore(*head, pair.device.imu_id, self.OFFSETS)))
        pair.run(0.1)
        assert pair.device.profile is None
        recorded = self.restore(pair, pair.device.imu_id)
        pair.line.inject(recorded)
        pair.run(0.1)
        pair.device.profile = None
        pair.line.inject(recorded)
        pair.run(0.1)
        assert pair.device.profile is None

    @pytest.mark.parametrize("late_s, imu_id", [(10.5, None), (1.0, bytes(16))])
    def test_not_later_and_not_anothers(self, late_s: float, imu_id: bytes | None) -> None:
        pair = paired()
        pair.run(late_s)
        pair.line.inject(self.restore(pair, imu_id or pair.device.imu_id))
        pair.run(0.1)
        assert pair.device.profile is None
