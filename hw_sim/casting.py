"""Which sensors to emulate and how they move, from the command line."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path

from appliance.sensor.keys import SensorKey, create_keys, exposure, load_keys, unknown_sensor
from hw_sim import motions
from hw_sim.device import Device, DeviceMaker
from hw_sim.emulated_sensor import PERIOD_US, EmulatedSensor
from hw_sim.status import sensors
from hw_sim.wearer import Wearer

DEFAULT_SENSOR = "left-wrist"
MOST_SENSORS = 8


class MotionKind(StrEnum):
    """How a sensor moves."""

    turning = "turning"
    dance = "dance"
    still = "still"
    step = "step"
    trace = "trace"


def choose_keys(path: Path, names: Sequence[str], count: int | None) -> tuple[list[SensorKey], list[str]]:
    """The keys of the emulated sensors: the named ones, the first `count`, or all; and remarks for the user.

    Writes a new key file if there is none. Raises ValueError, KeyFileError, OSError.
    """
    if names and count is not None:
        raise ValueError("give either --sensor or --count")
    if len(set(names)) < len(names) or len(names) > MOST_SENSORS:
        raise ValueError(f"--sensor takes one to {MOST_SENSORS} different sensors")
    remarks: list[str] = []
    if not path.exists():
        new = names or [DEFAULT_SENSOR, *(f"sensor-{number}" for number in range(2, (count or 1) + 1))]
        create_keys(path, new)
        remarks.append(f"Wrote {path} with fresh keys for {', '.join(new)}. The box must read the same file.")
    keys = load_keys(path)
    remarks += filter(None, [exposure(path)])
    for name in names:
        if name not in keys:
            raise ValueError(f"{path}: {unknown_sensor(name, keys)}")
    wanted = count or min(max(len(keys), 1), MOST_SENSORS)
    if not names and len(keys) < wanted:
        raise ValueError(f"{path} has {sensors(len(keys))}, not {wanted}. Add some, or give another --keys")
    return [keys[name] for name in names or list(keys)[:wanted]], remarks


def cast_sensors(
    keys: Sequence[SensorKey],
    motion_of: Callable[[int, str], motions.Motion],
    seed: int,
    *,
    stand_still_s: float = 0.0,
    taps: bool = False,
    drift_ppm: float = 0.0,
    reboot_every_s: float | None = None,
    make: DeviceMaker = EmulatedSensor,
) -> list[Device]:
    """A sensor for each key, with a place in the 20 ms grid by the seed; motion_of(number, name) moves it."""
    phases = random.Random(f"phases {seed}")
    return [
        make(
            key,
            Wearer(motion_of(number, key.name), stand_still_s, taps),
            phase_s=phases.uniform(0.0, PERIOD_US * 1e-6),
            drift_ppm=drift_ppm,
            reboot_every_s=reboot_every_s,
        )
        for number, key in enumerate(keys)
    ]


def name_and_motion(sensor: str) -> tuple[str, MotionKind | None]:
    """NAME or NAME=MOTION. Raises ValueError for an unknown motion."""
    name, equals, kind = sensor.partition("=")
    if equals and kind not in list(MotionKind):
        raise ValueError(f"there is no motion {kind!r}; there are: {', '.join(MotionKind)}")
    return name, MotionKind(kind) if equals else None


def parse_axis(text: str) -> tuple[float, float, float]:
    """x,y,z. Raises ValueError for anything but three numbers."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--axis takes three numbers, for instance 0,1,0, and not {text!r}") from None
    return x, y, z
