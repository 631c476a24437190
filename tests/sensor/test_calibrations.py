"""A sensor's saved calibration, the box's side: kept once, bounded, and restored to its own IMU alone."""

from __future__ import annotations

from appliance.sensor import wire
from appliance.sensor.memory import MOST_PROFILES
from tests.sensor.peers import IMU_ID, Box, dance, state

OFFSETS = bytes(range(22))


def test_a_calibration_is_restored_to_a_sensor_that_has_none() -> None:
    box = Box(profiles={IMU_ID: OFFSETS})
    sensor = box.pair()
    heard = dance(box, sensor, 10.0)
    restores = [packet for packet in heard if isinstance(packet, wire.Restore)]
    assert len(restores) == 5
    assert isinstance(heard[0], wire.Heartbeat) and heard[1] is restores[0]
    assert {(packet.imu_id, packet.offsets) for packet in restores} == {(IMU_ID, OFFSETS)}


def test_a_calibration_is_restored_until_it_is_in_use() -> None:
    box = Box(profiles={IMU_ID: OFFSETS})
    sensor = box.pair()
    dance(box, sensor, 0.02)
    sensor.flags = wire.HAS_PROFILE
    assert [type(packet) for packet in dance(box, sensor, 3.0)] == [wire.Heartbeat] * 3
    assert box.link.sent["restore"] == 1
    assert state(box).flags == wire.HAS_PROFILE


def test_another_imus_calibration_is_not_restored() -> None:
    box = Box(profiles={bytes(16): OFFSETS})
    dance(box, box.pair(), 2.0)
    assert box.link.sent["restore"] == 0


def test_a_saved_calibration_is_kept_once_and_goes_to_the_next_power_on() -> None:
    box = Box()
    sensor = box.pair()
    assert box.hear(sensor.profile(OFFSETS)) == ()  # nobody knows yet that it is there: not linked
    dance(box, sensor, 0.02)
    sent = [sensor.profile(OFFSETS) for _ in range(3)]
    box.hear(*sent)
    box.hear(*sent)
    assert box.link.take_profiles() == [(IMU_ID, OFFSETS)]
    assert box.link.take_profiles() == []
    assert box.counted() == {"hello": 1, "old_session": 1, "accepted": 1, "profile": 3, "duplicate": 3}
    dance(box, box.pair(boot=2), 0.02)
    assert box.link.sent["restore"] == 1


def test_a_sensor_that_sends_calibrations_without_end_fills_nothing() -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.reading())
    for number in range(1000):
        assert box.hear(sensor.profile(imu_id=number.to_bytes(16, "big"))) == ()
    taken = box.link.take_profiles()
    assert [imu_id[-2:] for imu_id, _ in taken] == [
        number.to_bytes(2, "big") for number in range(1000 - MOST_PROFILES, 1000)
    ]
    assert box.link.take_profiles() == []
