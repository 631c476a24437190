"""The box's memory of its sensors, as a record: neutral poses by sensor and joint, calibrations by IMU.

The record is text in memory and on the disk, so that people can read, edit and remove the file.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from appliance.box.record import Record, WholeFile
from appliance.pose.foreign_yaml import plain_values
from appliance.sensor.neutral import NeutralPose

FILE_NAME = "sensors.memory"
HEADER = "# The memory of this box of its sensors: neutral poses, and calibrations by the IMU's id.\n"
IMU_ID_BYTES = 16
OFFSETS_BYTES = 22
LARGEST = 256 * 1024  # bytes
MOST_PROFILES = 64  # more IMUs than any installation has: more would only fill the file

Worn = tuple[str, str]  # sensor, joint


class DamagedMemoryError(ValueError):
    """Raises ValueError if no box wrote the text."""


def memory_record(state: Path) -> Record:
    """In memory, and valid only for this state folder."""
    return Record(FILE_NAME, "sensors", LARGEST, os.fsencode(state.absolute()))


def memory_file(state: Path) -> WholeFile:
    """On the disk."""
    return WholeFile(state / FILE_NAME, LARGEST)


def forget_memory(runtime: Path, state: Path) -> None:
    """Remove from memory what the disk has, so that a person may edit or remove the file. Never raises."""
    with (
        contextlib.suppress(OSError, ValueError),
        contextlib.closing(memory_record(state).reader(runtime)) as reader,
    ):
        if [reader.read()] == memory_file(state).read():
            (runtime / FILE_NAME).unlink()


def with_profile(profiles: Mapping[bytes, bytes], imu_id: bytes, offsets: bytes) -> dict[bytes, bytes]:
    """These calibrations and a new one; of too many the oldest give way."""
    kept = {other: those for other, those in profiles.items() if other != imu_id}
    kept[imu_id] = offsets
    for oldest in list(kept)[:-MOST_PROFILES]:
        del kept[oldest]
    return kept


def memory_text(neutral: Mapping[Worn, NeutralPose], profiles: Mapping[bytes, bytes]) -> str:
    """YAML by hand: a library's writer would keep the interpreter from the tick for milliseconds."""
    by_sensor: dict[str, list[str]] = {}
    for (sensor, joint), pose in neutral.items():
        orientation = ", ".join(f"{part:.7f}" for part in pose.orientation)
        by_sensor.setdefault(sensor, []).append(
            f"    {json.dumps(joint)}: {{orientation: [{orientation}], heading: {pose.heading:.7f}, "
            f"boot_nonce: {pose.boot_nonce}}}\n"
        )
    lines = [HEADER, "neutral:\n" if by_sensor else "neutral: {}\n"]
    for sensor, joints in by_sensor.items():
        lines += [f"  {json.dumps(sensor)}:\n", *joints]
    lines.append("profiles:\n" if profiles else "profiles: {}\n")
    lines += [f'  "{imu_id.hex()}": "{offsets.hex()}"\n' for imu_id, offsets in profiles.items()]
    return "".join(lines)


def read_memory(text: bytes) -> tuple[dict[Worn, NeutralPose], dict[bytes, bytes]]:
    """Neutral poses, and calibrations (22 bytes) by IMU (16 bytes). Raises DamagedMemoryError."""
    try:
        return _checked(plain_values(text.decode()))
    except (
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        OverflowError,
        RecursionError,
        yaml.YAMLError,
    ) as error:
        raise DamagedMemoryError(str(error)) from error


def _checked(values: Any) -> tuple[dict[Worn, NeutralPose], dict[bytes, bytes]]:
    """Raises ValueError, TypeError, KeyError or AttributeError for values of no such file."""
    neutral = {
        (str(sensor), str(joint)): _pose(entry)
        for sensor, joints in values["neutral"].items()
        for joint, entry in joints.items()
    }
    profiles = {bytes.fromhex(imu_id): bytes.fromhex(text) for imu_id, text in values["profiles"].items()}
    for imu_id, offsets in profiles.items():
        if (len(imu_id), len(offsets)) != (IMU_ID_BYTES, OFFSETS_BYTES):
            raise ValueError("a calibration of the wrong length")
    return neutral, profiles


def _pose(entry: Mapping[str, Any]) -> NeutralPose:
    w, x, y, z = (float(part) for part in entry["orientation"])
    length = math.hypot(w, x, y, z)
    heading, boot_nonce = float(entry["heading"]), int(entry["boot_nonce"])
    if not 0.99 < length < 1.01 or not math.isfinite(heading) or not 0 <= boot_nonce < 1 << 32:
        raise ValueError("no neutral pose")
    return NeutralPose((w / length, x / length, y / length, z / length), heading, boot_nonce)
