"""The box's memory of its sensors from night to night: neutral poses and calibrations."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

from appliance.box.block import BlockWriter
from appliance.sensor.memory import (
    FILE_NAME,
    DamagedMemoryError,
    Worn,
    memory_file,
    memory_record,
    memory_text,
    read_memory,
    with_profile,
)
from appliance.sensor.neutral import NeutralPose

_log = logging.getLogger(__name__)


class SensorMemory:
    """Neutral poses by sensor and joint, calibrations by IMU.

    Changes go into the runtime folder, which is memory: nothing here waits for a disk or raises. The keeper
    carries them to the state folder. A start reads the runtime folder, which has what the box knew
    last, and the disk where that has nothing: after each power-on.
    """

    def __init__(self, state: Path | None, runtime: Path | None = None) -> None:
        """state: the folder on the disk; None, or without a runtime folder: changes last for this run."""
        self._neutral: dict[Worn, NeutralPose] = {}
        self._profiles: dict[bytes, bytes] = {}
        self._writer: BlockWriter | None = None
        if state is None:
            return
        if runtime is None or not self._read_block(runtime, state):
            self._read_file(state)
        if runtime is None:
            return
        try:
            self._writer = memory_record(state).writer(runtime)
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
        """Release the runtime folder's file; its content stays."""
        if self._writer is not None:
            self._writer.close()

    def _write(self) -> None:
        if self._writer is None:
            return
        try:
            self._writer.write(memory_text(self._neutral, self._profiles).encode())
        except ValueError as error:  # in case of thousands of sensors
            self.close()
            self._writer = None
            self._complain(str(error))

    def _complain(self, reason: str) -> None:
        _log.warning(
            f"Neutral poses and calibrations cannot be kept ({reason}). The show goes on; after a restart "
            "sensors need a moment of stillness again. Free memory there, or give another folder as "
            "`runtime:` in the box file."
        )

    def _read_block(self, runtime: Path, state: Path) -> bool:
        """Continue from what the last stage wrote into memory; False where there is nothing of this box."""
        with closing(memory_record(state).reader(runtime)) as reader:
            text = reader.read()
        try:
            self._neutral, self._profiles = read_memory(text or b"")
        except DamagedMemoryError:
            return False
        return True

    def _read_file(self, state: Path) -> None:
        path = state / FILE_NAME
        try:
            for text in memory_file(state).read():
                self._neutral, self._profiles = read_memory(text)
        except OSError as error:
            _log.warning(
                f"{path}: what was remembered of the sensors cannot be read ({error.strerror}). "
                "Sensors need a moment of stillness tonight. Check the permissions of this file."
            )
        except ValueError:
            self._set_aside(path)

    def _set_aside(self, path: Path) -> None:
        broken = path.with_name(path.name + ".broken")
        remark = f"It is kept as {broken.name}"
        try:
            path.replace(broken)
        except OSError as error:
            remark = f"It could not be set aside ({error.strerror})"
        _log.warning(
            f"{path}: what was remembered of the sensors is damaged. {remark}; "
            "the show goes on, and sensors need a moment of stillness tonight."
        )
