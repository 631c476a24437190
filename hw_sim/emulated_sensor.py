"""One wearable as the box sees it: signed readings at 50 Hz on a clock of its own, now and then a reboot."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import NamedTuple

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim.motions import Motion, Quaternion

PERIOD_US = 20_000
BOOT_US = 700_000  # the IMU's start-up: the device clock at the first reading
REBOOT_S = 1.5  # silence between two power-ons
CALIBRATED = 0xFF


class Sample(NamedTuple):
    """One reading as the sensor made it."""

    sensor: str
    boot_nonce: int
    sequence: int
    sampled_at: float  # seconds, the emulator's clock
    orientation: Quaternion
    datagram: bytes


def fresh_boot_nonce() -> int:
    """Not from the seed: a box that runs on would take a repeated power-on for a replay, and rightly so."""
    return secrets.randbits(32)


class EmulatedSensor:
    """Makes signed readings. Time is an argument: seconds on the emulator's clock.

    phase_s: when in the 20 ms grid it measures. drift_ppm: how much too fast its clock is. device_time_us:
    what its clock says at the first reading. reboot_every_s: switched off and on again that often; None:
    never.
    """

    def __init__(
        self,
        key: SensorKey,
        motion: Motion,
        *,
        phase_s: float = 0.0,
        drift_ppm: float = 0.0,
        device_time_us: int = BOOT_US,
        reboot_every_s: float | None = None,
        boot_nonce: Callable[[], int] = fresh_boot_nonce,
    ) -> None:
        self.name = key.name
        self.reboots = 0
        self._device_id = key.device_id
        self._tagger = wire.Tagger(key.key)
        self._motion = motion
        self._phase_s = phase_s
        self._period_s = PERIOD_US * 1e-6 / (1 + drift_ppm * 1e-6)
        self._device_time_us = device_time_us
        self._reboot_every_s = reboot_every_s
        self._draw_nonce = boot_nonce
        self._started: float | None = None

    def start(self, now: float) -> None:
        """Switched on at `now`."""
        self._started = now
        self._switch_on(now + self._phase_s)

    @property
    def next_at(self) -> float:
        """When the next reading is due."""
        return self._switched_on_at + self._readings * self._period_s

    def sample(self) -> Sample:
        """The reading that is due at `next_at`."""
        assert self._started is not None, "start() comes first"
        sampled_at = self.next_at
        orientation = self._motion(sampled_at - self._started)
        reading = wire.Reading(
            self._device_id,
            self._boot_nonce,
            0,
            self._readings % (1 << 32),
            (self._device_time_us + self._readings * PERIOD_US) % (1 << 32),
            orientation,
            CALIBRATED,
            wire.BATTERY_UNKNOWN,
            wire.ROUND_TRIP_UNKNOWN,
            taps=0,
            recoveries=0,
            flags=0,
        )
        sample = Sample(
            self.name,
            self._boot_nonce,
            reading.sequence,
            sampled_at,
            orientation,
            wire.pack(reading, self._tagger),
        )
        self._readings += 1
        if self._reboot_every_s and self.next_at - self._switched_on_at > self._reboot_every_s:
            self.reboots += 1
            self._device_time_us = BOOT_US
            self._switch_on(self.next_at + REBOOT_S)
        return sample

    def skip_to(self, now: float) -> None:
        """Leaves out the readings before `now`, as if they had been lost: the machine was asleep."""
        self._readings += max(0, int((now - self.next_at) / self._period_s))

    def _switch_on(self, at: float) -> None:
        self._switched_on_at = at
        self._readings = 0
        self._boot_nonce = self._draw_nonce()
