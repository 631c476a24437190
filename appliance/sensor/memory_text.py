"""The sensors' memory as text: neutral poses by sensor and joint, calibrations by the IMU's id."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import yaml

from appliance.sensor.neutral import NeutralPose

HEADER = "# What this box remembers of its sensors: neutral poses, and calibrations by the IMU's id.\n"
IMU_ID_BYTES = 16
OFFSETS_BYTES = 22
LARGEST = 256 * 1024  # bytes
MOST_PROFILES = 64  # more IMUs than any installation has: more would only fill the file

Worn = tuple[str, str]  # sensor, joint


class DamagedMemoryError(ValueError):
    """The text is none that a box wrote."""


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


def remembered(text: str) -> tuple[dict[Worn, NeutralPose], dict[bytes, bytes]]:
    """Neutral poses, and calibrations (22 bytes) by IMU (16 bytes). Raises DamagedMemoryError."""
    try:
        return _remembered(yaml.load(text, _PlainLoader))
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


class _PlainLoader(yaml.SafeLoader):
    """Without aliases: the box writes none, and a few of them can stand for more than any memory holds."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias")
        return super().compose_node(parent, index)


def _remembered(values: Any) -> tuple[dict[Worn, NeutralPose], dict[bytes, bytes]]:
    """What a file's values say. Raises ValueError, TypeError, KeyError or AttributeError for nonsense."""
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
