"""A wearable in Python: power, the IMU's start-up, its own clock, pairing, signed readings at 50 Hz.

Linked, it takes 1.1 ms of processor time a second; the compiled firmware takes 9.9, and needs a compiler.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from hashlib import blake2s

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim.device import Lane, Outgoing, Sample
from hw_sim.motions import Quaternion
from hw_sim.pairing import Pairing
from hw_sim.wearer import Wearer

PERIOD_US = 20_000
RATES_US = ((100, 10_000), (50, PERIOD_US), (0, 40_000))  # lowest rate asked for -> period
IMU_START_US = 700_000  # the BNO055's first reading after power-on
REBOOT_S = 1.5  # off between two power-ons
ASLEEP_S = 0.5  # further behind than this, readings are skipped instead of sent in a burst
PROFILE_TIMES, PROFILE_EVERY_S = 3, 1.0
CALIBRATED = 0xFF
FIRMWARE = (1, 0, 0)
LIGHTS = {
    wire.LED_OFF: "off",
    wire.LED_ON: "on",
    wire.LED_SLOW: "slow",
    wire.LED_FAST: "fast",
    wire.LED_STROBE: "strobe",
}


def fresh_boot_nonce() -> int:
    """Not from the seed: a running box rightly takes a repeated power-on for a replay."""
    return secrets.randbits(32)


def sensor_axes(stage: Quaternion) -> Quaternion:
    """The same rotation in the BNO055's axes (z up, x to the front); stage: y up, z to the front."""
    w, x, y, z = stage
    return w, z, x, y


class EmulatedSensor:
    """A Device that speaks the whole protocol. Time is an argument: seconds on the emulator's clock.

    phase_s: when in the 20 ms grid it measures. drift_ppm: how much too fast its clock is. device_time_us:
    its clock at power-on. reboot_every_s: time between power cycles; None: never. profile: its calibration,
    the BNO055's 22 offset bytes. taps: double taps since power-on.
    """

    def __init__(
        self,
        key: SensorKey,
        wearer: Wearer,
        *,
        phase_s: float = 0.0,
        drift_ppm: float = 0.0,
        reboot_every_s: float | None = None,
        device_time_us: int = 0,
        boot_nonce: Callable[[], int] = fresh_boot_nonce,
    ) -> None:
        self.name = key.name
        self.reboots = 0
        self.imu_id = blake2s(key.device_id.to_bytes(4, "little"), digest_size=16).digest()
        self.profile: bytes | None = None
        self.taps = 0
        self.recoveries = 0
        self.battery = wire.BATTERY_UNKNOWN
        self.wire_hash = wire.WIRE_HASH
        self._device_id = key.device_id
        self._tagger = wire.Tagger(key.key)
        self._wearer = wearer
        self._phase_s = phase_s
        self._clock_rate = 1 + drift_ppm * 1e-6
        self._reboot_every_s = reboot_every_s
        self._device_time_us = device_time_us
        self._draw_nonce = boot_nonce
        self._lanes_up: set[Lane] = set()
        self._pairing: Pairing | None = None  # None: switched off
        self._power_on_at = 0.0
        self._power_change_at = float("inf")
        self._grid_us = 0  # microseconds of the device clock, from power-on to the next measurement
        self._readings = 0
        self._profiles = 0  # sent of this power-on
        self._profiles_due = 0
        self._profile_at = 0.0

    @property
    def boot_nonce(self) -> int:
        """The nonce of the present power-on; 0 while off."""
        return self._pairing.boot_nonce if self._pairing else 0

    @property
    def is_linked(self) -> bool:
        return self._pairing is not None and self._pairing.lane is not None

    @property
    def light(self) -> str:
        """The lamp: off, looking, or as the box sets it."""
        if self._pairing is None:
            return "off"
        return LIGHTS.get(self._pairing.led, "on") if self.is_linked else "looking"

    @property
    def next_at(self) -> float:
        due = self._power_change_at
        if self._pairing is not None:
            due = min(due, self._reading_at, self._pairing.next_at)
            if self._profiles_due and self.is_linked:
                due = min(due, self._profile_at)
        return due

    def start(self, now: float) -> None:
        self._wearer.start(now)
        self.switch_on(now)

    def switch_on(self, now: float) -> None:
        """Power on: only the calibration is left of the power-on before."""
        self._pairing = pairing = Pairing(self._draw_nonce())
        for lane in self._lanes_up:
            pairing.connect(lane, True, now)
        self._power_on_at = now
        self._power_change_at = now + self._reboot_every_s if self._reboot_every_s else float("inf")
        self._grid_us = IMU_START_US
        self._readings = self._profiles = self.taps = self.recoveries = 0

    def switch_off(self, now: float, seconds: float = float("inf")) -> None:
        """Power off, and on again after `seconds`."""
        self._pairing = None
        self._power_change_at = now + seconds

    def connect(self, lane: Lane, is_up: bool, now: float) -> None:
        (self._lanes_up.add if is_up else self._lanes_up.discard)(lane)
        if self._pairing is not None:
            self._pairing.connect(lane, is_up, now)

    def save_profile(self, offsets: bytes, now: float) -> None:
        """As after a calibration: use the 22 bytes, and send them to the box once linked."""
        self.profile, self._profiles_due, self._profile_at = offsets, PROFILE_TIMES, now

    def step(self, now: float) -> list[Outgoing]:
        while self._power_change_at <= now:
            at = self._power_change_at
            if self._pairing is not None:
                self.switch_off(at, REBOOT_S)
            else:
                self.reboots += 1
                self._device_time_us = 0
                self.switch_on(at)
        if self._pairing is None:
            return []
        left = self._hellos(self._pairing, now)
        left += self._measure(self._pairing, now)
        left += self._due_profiles(self._pairing, now)
        return left

    def receive_packet(self, data: bytes, now: float, lane: Lane) -> None:
        pairing = self._pairing
        if pairing is None:
            return
        try:
            packet = wire.unpack(data, lambda device: self._tagger if device == self._device_id else None)
        except wire.WireError:
            return
        if packet.boot_nonce != pairing.boot_nonce:
            return
        match packet:
            case wire.Assignment():
                pairing.take_assignment(packet, now, lane)
            case wire.Heartbeat():
                pairing.take_heartbeat(packet, now)
            case wire.Call():
                pairing.take_call(now, lane)
            case wire.Restore() if pairing.take_restore(packet, now) and packet.imu_id == self.imu_id:
                self.profile = self.profile or packet.offsets

    def close(self) -> None:
        """Nothing to free."""

    @property
    def _reading_at(self) -> float:
        return self._power_on_at + self._phase_s + self._grid_us * 1e-6 / self._clock_rate

    @property
    def _flags(self) -> int:
        return wire.HAS_PROFILE if self.profile is not None else 0

    def _hellos(self, pairing: Pairing, now: float) -> list[Outgoing]:
        left = []
        for at, lane, sequence in pairing.due_hellos(now):
            head = self._device_id, pairing.boot_nonce, pairing.session, sequence
            hello = wire.Hello(*head, self.wire_hash, *FIRMWARE, self.battery, self._flags, self.imu_id)
            left.append(Outgoing(wire.pack(hello, self._tagger), lane, at))
        return left

    def _measure(self, pairing: Pairing, now: float) -> list[Outgoing]:
        """Readings that are due; the grid continues without a link."""
        period_us = next(period for rate, period in RATES_US if pairing.rate_hz >= rate)
        if now - self._reading_at > ASLEEP_S:
            missed = int((now - self._reading_at) * 1e6 * self._clock_rate / period_us)
            self._grid_us += missed * period_us
            self._readings += missed if pairing.lane is not None else 0
        left = []
        while (at := self._reading_at) <= now:
            if pairing.lane is not None:
                left.append(self._reading(pairing, pairing.lane, at))
            self._grid_us += period_us
        return left

    def _reading(self, pairing: Pairing, lane: Lane, at: float) -> Outgoing:
        self.taps += self._wearer.reading_sent(at)
        orientation = self._wearer.orientation(at)
        sequence, self._readings = self._readings, self._readings + 1
        reading = wire.Reading(
            *(self._device_id, pairing.boot_nonce, pairing.session, sequence),
            (self._device_time_us + self._grid_us) % (1 << 32),
            sensor_axes(orientation),
            *(
                CALIBRATED,
                self.battery,
                pairing.round_trip,
                self.taps % 256,
                self.recoveries % 256,
                self._flags,
            ),
        )
        pairing.reading_sent(sequence, at)
        sample = Sample(self.name, pairing.boot_nonce, sequence, at, orientation, self._power_on_at)
        return Outgoing(wire.pack(reading, self._tagger), lane, at, sample)

    def _due_profiles(self, pairing: Pairing, now: float) -> list[Outgoing]:
        if self.profile is None or pairing.lane is None or not self._profiles_due or self._profile_at > now:
            return []
        self._profiles_due -= 1
        self._profile_at = now + PROFILE_EVERY_S
        packet = wire.Profile(
            *(self._device_id, pairing.boot_nonce, pairing.session, self._profiles),
            *(self.imu_id, self.profile),
        )
        self._profiles += 1
        return [Outgoing(wire.pack(packet, self._tagger), pairing.lane, now)]
