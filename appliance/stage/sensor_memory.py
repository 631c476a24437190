"""What the box remembers of its sensors from night to night: neutral poses and calibrations."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path

from appliance.sensor.memory_block import FILE_NAME, MemoryReader, MemoryWriter, text_on_disk
from appliance.sensor.memory_text import DamagedMemoryError, Worn, memory_text, remembered, with_profile
from appliance.sensor.neutral import NeutralPose


class SensorMemory:
    """Neutral poses by sensor and joint, calibrations by IMU.

    What is new goes into the runtime folder, which is memory: to keep something never waits, and nothing here
    raises. The keeper carries it to the state folder. A start takes what the runtime folder has, which is
    what the box knew last, and reads the disk where that has nothing: after each power-on.
    """

    def __init__(self, state: Path | None, say: Callable[[str], None], runtime: Path | None = None) -> None:
        """state: the folder on the disk; None, or without a runtime folder: what is new is for this run."""
        self._say = say
        self._neutral: dict[Worn, NeutralPose] = {}
        self._profiles: dict[bytes, bytes] = {}
        self._writer: MemoryWriter | None = None
        if state is None:
            return
        if runtime is None:
            self._load(state)
            return
        if not self._take_up(runtime, state):
            self._load(state)
        try:
            self._writer = MemoryWriter(runtime, state)
        except OSError as error:
            self._complain(f"{runtime}: {error.strerror}")

    def neutral(self, sensor: str, joint: str) -> NeutralPose | None:
        """The newest neutral pose of a joint with this sensor, if there ever was one."""
        return self._neutral.get((sensor, joint))

    def keep_neutral(self, sensor: str, poses: Mapping[str, NeutralPose]) -> None:
        """Remember the neutral poses of a sensor's joints; a start finds all of them, or none."""
        self._neutral.update({(sensor, joint): pose for joint, pose in poses.items()})
        self._write()

    @property
    def profiles(self) -> dict[bytes, bytes]:
        """Calibration offsets (22 bytes) by the unique id of the IMU (16 bytes)."""
        return dict(self._profiles)

    def keep_profile(self, imu_id: bytes, offsets: bytes) -> None:
        """Remember the calibration of an IMU."""
        if self._profiles.get(imu_id) != offsets:
            self._profiles = with_profile(self._profiles, imu_id, offsets)
            self._write()

    def close(self) -> None:
        """Let go of the runtime folder's file; what is in it stays."""
        if self._writer is not None:
            self._writer.close()

    def _write(self) -> None:
        if self._writer is None:
            return
        try:
            self._writer.write(memory_text(self._neutral, self._profiles))
        except ValueError as error:  # of thousands of sensors
            self.close()
            self._writer = None
            self._complain(str(error))

    def _complain(self, reason: str) -> None:
        self._say(
            f"Neutral poses and calibrations cannot be kept ({reason}). The show goes on; after a restart "
            "sensors need a moment of stillness again. Free memory there, or give another folder as "
            "`runtime:` in the box file."
        )

    def _take_up(self, runtime: Path, state: Path) -> bool:
        """Go on with what the last stage wrote into memory; False where there is nothing of this box."""
        reader = MemoryReader(runtime, state)
        text = reader.read()
        reader.close()
        if text is None:
            return False
        with contextlib.suppress(DamagedMemoryError):
            self._neutral, self._profiles = remembered(text)
            return True
        return False

    def _load(self, state: Path) -> None:
        path = state / FILE_NAME
        try:
            text = text_on_disk(state)
            if text is not None:
                self._neutral, self._profiles = remembered(text)
        except OSError as error:
            self._say(
                f"{path}: what was remembered of the sensors cannot be read ({error.strerror}). "
                "Sensors need a moment of stillness tonight. Check who may read this file."
            )
        except ValueError:
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
