"""One wearable in the emulator: what emulated sensor and compiled firmware have in common."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

from appliance.sensor.keys import SensorKey
from hw_sim.motions import Quaternion
from hw_sim.wearer import Wearer


class Lane(IntEnum):
    """How a wearable reaches the box."""

    NETWORK = 0
    CABLE = 1


class Sample(NamedTuple):
    """One reading as the sensor made it; times in seconds of the emulator's clock."""

    sensor: str
    boot_nonce: int
    sequence: int
    sampled_at: float
    orientation: Quaternion  # the hand's own, stage axes
    power_on_at: float  # when this boot began


class Outgoing(NamedTuple):
    """A packet that leaves a wearable: signed, whole, without the framing of a cable."""

    data: bytes
    lane: Lane
    at: float  # when it left, seconds of the emulator's clock, at most the time of its step
    sample: Sample | None = None  # the reading in it; None for every other packet


class Device(Protocol):
    """A wearable. Time is an argument: seconds on the emulator's clock, never going back.

    name: as in the key file. reboots: power-ons after the first. light: what its lamp says, one word.
    A new device is off and both its lanes are down.
    """

    name: str
    reboots: int

    @property
    def light(self) -> str: ...

    @property
    def next_at(self) -> float:
        """When `step` has something to do next."""

    def start(self, now: float) -> None:
        """Switch on for the first time."""

    def connect(self, lane: Lane, is_up: bool, now: float) -> None:
        """The network is joined or lost, the cable plugged in or pulled out. Only called on a change."""

    def step(self, now: float) -> list[Outgoing]:
        """Packets sent since the last step. After a long sleep of the machine readings are skipped."""

    def receive_packet(self, data: bytes, now: float, lane: Lane) -> None:
        """Take a packet from the box, perhaps damaged, repeated or for another sensor. Never raises."""

    def close(self) -> None:
        """Free what it holds."""


class DeviceMaker(Protocol):
    """How the command line makes a device: the emulated sensor itself, or the compiled firmware.

    phase_s: when in the 20 ms grid it measures. drift_ppm: how much too fast its clock is. reboot_every_s:
    switched off and on again that often; None: never.
    """

    def __call__(
        self,
        key: SensorKey,
        wearer: Wearer,
        *,
        phase_s: float,
        drift_ppm: float,
        reboot_every_s: float | None,
    ) -> Device: ...
