"""A wearable that runs the compiled firmware: provisioned by its console, on a simulated board."""

from __future__ import annotations

import re
import secrets
from collections import Counter

from appliance.sensor import wire
from appliance.sensor.framing import Deframer, frame
from appliance.sensor.keys import SensorKey
from hw_sim.device import DeviceMaker, Lane, Outgoing, Sample
from hw_sim.emulated_sensor import ASLEEP_S, REBOOT_S, sensor_axes
from hw_sim.firmware_library import IMUS, CompiledWearable, State
from hw_sim.wearer import Wearer

NETWORK, PASSWORD = "bunraku", "curtain up"
BOX = (0x7F000001, 9750)  # where the box is, as the simulated radio sees it
STEP_S = 0.002
ANSWER_WITHIN_US = 1_000_000
POLL_US = 5_000
CLOCK_WRAPS_S = (1 << 32) * 1e-6
# The lamp by the seconds from flash to flash, see docs/dancer.md.
LIGHTS = ((0.15, "strobe"), (0.5, "fast"), (1.6, "slow"), (4.0, "on"))


class ProvisioningError(ValueError):
    """The firmware's console refused a command; the message has its answer."""


def provision(
    key: SensorKey, *, port: int = BOX[1], network: str = NETWORK, password: str = PASSWORD, seed: int = 1
) -> bytes:
    """The flash of a wearable after `bunraku provision`, through the console on its simulated cable.

    Raises FirmwareMissingError, ProvisioningError.
    """
    wearable = CompiledWearable(seed=seed)
    try:
        wearable.power(True)
        wearable.connect_cable(True)
        for line in (
            f"set device {key.device_id:08x}",
            f"set key {key.key.hex()}",
            f"set name {re.sub('[^!-~]', '-', key.name)}",
            f"set network {network}",
            f"set password {password}",
            f"set port {port}",
            "save",
        ):
            answer = ask(wearable, line)
            if not answer.startswith("ok"):
                command = " ".join(line.split()[:2])
                raise ProvisioningError(f"the wearable refused '{command}': {answer or 'no answer'}")
        return wearable.flash_image()
    finally:
        wearable.close()


def ask(wearable: CompiledWearable, line: str) -> str:
    """Type a line into the console. Returns its answer, or "" after a second without one."""
    wearable.put_serial(line.encode() + b"\n")
    received = b""
    now_us = wearable.status.now_us
    for _ in range(ANSWER_WITHIN_US // POLL_US):
        now_us = wearable.step_until(now_us + POLL_US)
        received += wearable.take_serial()
        *lines, _ = received.split(b"\n")
        for text in lines:
            if text.startswith((b"ok", b"error")):
                return text.decode(errors="replace").strip()
    return ""


def firmware_maker(seed: int | None = None, imu: str = IMUS[0]) -> DeviceMaker:
    """Makes wearables with that IMU for the emulator.

    The same seed gives the same bytes; None: each run differs. A running box rightly takes a
    power-on with the same bytes for a replay.
    """

    def make(
        key: SensorKey, wearer: Wearer, *, phase_s: float, drift_ppm: float, reboot_every_s: float | None
    ) -> FirmwareSensor:
        own = secrets.randbits(64) if seed is None else (seed << 32) + key.device_id
        return FirmwareSensor(
            key,
            wearer,
            phase_s=phase_s,
            drift_ppm=drift_ppm,
            reboot_every_s=reboot_every_s,
            seed=own,
            imu=imu,
        )

    return make


class FirmwareSensor:
    """A Device around one CompiledWearable; the emulator's seconds are its virtual time.

    phase_s: its delay at power-on. seed: of all randomness in its world. imu: the chip that is wired to it.
    Raises FirmwareMissingError, ProvisioningError.
    """

    def __init__(
        self,
        key: SensorKey,
        wearer: Wearer,
        *,
        phase_s: float = 0.0,
        drift_ppm: float = 0.0,
        reboot_every_s: float | None = None,
        seed: int = 1,
        imu: str = IMUS[0],
    ) -> None:
        self.name = key.name
        self.reboots = 0
        self._wearer = wearer
        self._phase_s = phase_s
        self._drift_ppm = drift_ppm
        self._reboot_every_s = reboot_every_s
        self._seed = seed
        self._imu = imu
        self._flash = provision(key, seed=seed + 1)
        self._wearable: CompiledWearable | None = None  # None before the first power-on
        self._now = 0.0
        self._power_on_at = 0.0
        self._power_change_at = float("inf")
        self._lanes_up: set[Lane] = set()
        self._deframer = Deframer(Counter())
        self._to_leave: list[Outgoing] = []
        self._flashes: tuple[float, float] = (float("-inf"), float("-inf"))  # the newest two

    @property
    def wearable(self) -> CompiledWearable:
        assert self._wearable is not None, "start() comes first"
        return self._wearable

    @property
    def light(self) -> str:
        """off; looking (for network or box); else what the lamp shows."""
        status = self.wearable.status
        if not status.is_on:
            return "off"
        if status.state != State.LINKED:
            return "looking"
        before, newest = self._flashes
        period_s = max(newest - before, self._now - newest)
        return next((word for longest_s, word in LIGHTS if period_s < longest_s), "off")

    @property
    def next_at(self) -> float:
        return self._now + STEP_S

    def start(self, now: float) -> None:
        self._now = now
        self._wearer.start(now)
        self._wearable = CompiledWearable(
            self._flash, seed=self._seed, start_us=_us(now), drift_ppm=self._drift_ppm, imu=self._imu
        )
        self._wearable.set_network(NETWORK, PASSWORD)
        for lane in self._lanes_up:
            self._connect(lane, True, now)
        self._power_change_at = now + self._phase_s

    def switch_off(self, now: float, seconds: float = float("inf")) -> None:
        """Power off, and on again after `seconds`."""
        self.wearable.power(False)
        self._power_change_at = now + seconds

    def connect(self, lane: Lane, is_up: bool, now: float) -> None:
        (self._lanes_up.add if is_up else self._lanes_up.discard)(lane)
        if self._wearable is not None:
            self._connect(lane, is_up, now)

    def step(self, now: float) -> list[Outgoing]:
        while self._now < now:
            self._now = min(now, self._now + STEP_S)
            if self._power_change_at <= self._now:
                self._switch()
            self.wearable.go_to(sensor_axes(self._wearer.orientation(self._now)), _us(self._now))
            self.wearable.step_until(_us(self._now))
            self._collect()
        left = [one for one in self._to_leave if now - ASLEEP_S <= one.at <= now]
        self._to_leave = [one for one in self._to_leave if one.at > now]
        return left

    def receive_packet(self, data: bytes, now: float, lane: Lane) -> None:
        if lane == Lane.CABLE:
            self.wearable.put_serial(b"\0" + frame(data))
        else:
            self.wearable.put_datagram(BOX, data)

    def close(self) -> None:
        if self._wearable is not None:
            self._wearable.close()

    def _connect(self, lane: Lane, is_up: bool, now: float) -> None:
        if lane == Lane.CABLE:
            self.wearable.connect_cable(is_up)
        else:
            self.wearable.set_access_point(is_up, _us(now))

    def _switch(self) -> None:
        """Power on; or off for a moment, when it is time for a reboot."""
        at = self._power_change_at
        if self.wearable.status.is_on:
            self.switch_off(at, REBOOT_S)
            return
        self.reboots += self.wearable.status.power_ons > 0
        self.wearable.power(True)
        self._power_on_at = at
        self._power_change_at = at + self._reboot_every_s if self._reboot_every_s else float("inf")

    def _collect(self) -> None:
        """Collect what left: packets on both lanes, and flashes of the lamp."""
        for at_us, _, data in self.wearable.take_datagrams():
            self._leave(data, Lane.NETWORK, at_us * 1e-6)
        for data in self._deframer.feed(self.wearable.take_serial()):
            self._leave(data, Lane.CABLE, self.wearable.status.now_us * 1e-6)
        for at_us, is_on in self.wearable.take_light():
            if is_on:
                self._flashes = self._flashes[1], at_us * 1e-6

    def _leave(self, data: bytes, lane: Lane, at: float) -> None:
        sample = self._sample(data) if len(data) == wire.READING.size else None
        if sample is not None:
            self._wearer.reading_sent(at)
        self._to_leave.append(Outgoing(data, lane, at, sample))

    def _sample(self, data: bytes) -> Sample:
        """The reading in a packet, with the hand's true orientation at its device time."""
        _, _, _, _, boot_nonce, _, sequence = wire.HEAD.unpack_from(data)
        device_s = int.from_bytes(data[wire.HEAD.size : wire.HEAD.size + 4], "little") * 1e-6
        booted_at = self.wearable.status.booted_at_us * 1e-6
        clock_rate = 1 + self._drift_ppm * 1e-6
        # The clock in a packet begins anew after 72 minutes.
        device_s += CLOCK_WRAPS_S * round(((self._now - booted_at) * clock_rate - device_s) / CLOCK_WRAPS_S)
        measured_at = booted_at + device_s / clock_rate
        orientation = self._wearer.orientation(measured_at)
        return Sample(self.name, boot_nonce, sequence, measured_at, orientation, self._power_on_at)


def _us(seconds: float) -> int:
    return round(seconds * 1e6)
