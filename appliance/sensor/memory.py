"""What the box remembers of its sensors from night to night: neutral poses and calibrations."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from appliance.sensor.neutral import NeutralPose
from appliance.sensor.private_file import replace_private

FILE_NAME = "sensors.memory"
HEADER = "# What this box remembers of its sensors: neutral poses, and calibrations by the IMU's id.\n"
IMU_ID_BYTES = 16
OFFSETS_BYTES = 22
LARGEST_FILE = 256 * 1024
MOST_PROFILES = 64  # so many IMUs no house has: more would only fill the file

Place = tuple[str, str]  # sensor, joint


def with_profile(profiles: Mapping[bytes, bytes], imu_id: bytes, offsets: bytes) -> dict[bytes, bytes]:
    """These calibrations and a new one; of too many the oldest give way."""
    kept = {other: those for other, those in profiles.items() if other != imu_id}
    kept[imu_id] = offsets
    for oldest in list(kept)[:-MOST_PROFILES]:
        del kept[oldest]
    return kept


class SensorMemory:
    """Neutral poses by sensor and joint, calibrations by IMU, in a file of the state folder.

    The file is written in a thread of its own: to keep something never waits, and nothing here raises. What
    goes wrong with the file is said in one sentence, and the box remembers for this run only. `directory`
    None: this run only, from the start.
    """

    def __init__(self, directory: Path | None, say: Callable[[str], None]) -> None:
        self._say = say
        self._path = directory / FILE_NAME if directory is not None else None
        # Never changed in place: the writing thread takes them as they are.
        self._neutral: Mapping[Place, NeutralPose] = {}
        self._profiles: Mapping[bytes, bytes] = {}
        self._is_failing = False
        self._closing = False
        self._changed = threading.Event()
        self._thread: threading.Thread | None = None
        if self._path is not None:
            self._load(self._path)
            self._thread = threading.Thread(target=self._write_on, name="sensor memory", daemon=True)
            self._thread.start()

    def neutral(self, sensor: str, joint: str) -> NeutralPose | None:
        """The newest neutral pose of a joint with this sensor, if there ever was one."""
        return self._neutral.get((sensor, joint))

    def keep_neutral(self, sensor: str, joint: str, pose: NeutralPose) -> None:
        """Remember a neutral pose."""
        self._neutral = {**self._neutral, (sensor, joint): pose}
        self._changed.set()

    @property
    def profiles(self) -> dict[bytes, bytes]:
        """Calibration offsets (22 bytes) by the unique id of the IMU (16 bytes)."""
        return dict(self._profiles)

    def keep_profile(self, imu_id: bytes, offsets: bytes) -> None:
        """Remember the calibration of an IMU."""
        if self._profiles.get(imu_id) != offsets:
            self._profiles = with_profile(self._profiles, imu_id, offsets)
            self._changed.set()

    def close(self) -> None:
        """Write what is not written yet, and end the thread."""
        self._closing = True
        self._changed.set()
        if self._thread is not None:
            self._thread.join()

    def _write_on(self) -> None:
        written: tuple[Mapping[Place, NeutralPose], Mapping[bytes, bytes]] = (self._neutral, self._profiles)
        while True:
            self._changed.wait()
            self._changed.clear()
            is_last = self._closing
            kept = (self._neutral, self._profiles)
            if (kept[0] is not written[0] or kept[1] is not written[1]) and self._write(*kept):
                written = kept
            if is_last:
                return

    def _write(self, neutral: Mapping[Place, NeutralPose], profiles: Mapping[bytes, bytes]) -> bool:
        assert self._path is not None
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_private(self._path, _text(neutral, profiles))
        except OSError as error:
            if not self._is_failing:
                self._say(
                    f"{self._path}: neutral poses and calibrations cannot be kept ({error.strerror}). "
                    "The show goes on; after a restart sensors need a moment of stillness again. "
                    "Make the folder writable, or name another one under `state` in the box file."
                )
            self._is_failing = True
            return False
        self._is_failing = False
        return True

    def _load(self, path: Path) -> None:
        try:
            if path.stat().st_size > LARGEST_FILE:
                raise ValueError("it is too large")
            self._neutral, self._profiles = _remembered(
                yaml.load(path.read_text(encoding="utf-8"), _PlainLoader)
            )
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            self._say(
                f"{path}: what was remembered of the sensors cannot be read ({error.strerror}). "
                "Sensors need a moment of stillness tonight. Check who may read this file."
            )
        except (
            ValueError,
            TypeError,
            KeyError,
            AttributeError,
            OverflowError,
            RecursionError,
            yaml.YAMLError,
        ):
            self._set_aside(path)

    def _set_aside(self, path: Path) -> None:
        broken = path.with_name(path.name + ".broken")
        kept = f"It is kept as {broken.name}"
        try:
            path.replace(broken)
        except OSError as error:
            kept = f"It could not be set aside ({error.strerror})"
        self._say(
            f"{path}: what was remembered of the sensors is damaged. {kept}; "
            "the show goes on, and sensors need a moment of stillness tonight."
        )


def _text(neutral: Mapping[Place, NeutralPose], profiles: Mapping[bytes, bytes]) -> str:
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


class _PlainLoader(yaml.SafeLoader):
    """Without aliases: the box writes none, and a few of them can stand for more than any memory holds."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias")
        return super().compose_node(parent, index)


def _remembered(values: Any) -> tuple[dict[Place, NeutralPose], dict[bytes, bytes]]:
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
