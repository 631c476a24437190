"""A rehearsal as a training set, from the journal: a live dancer's dance, hands, sensors, cues and lights."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appliance.box.durable import write_whole
from appliance.exchange.formats import write_recording
from appliance.pose import quaternion
from appliance.pose.counted import counted
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import JournalRecording, Run
from appliance.recorder.timeline import message_of

PUPPET = "puppet"  # folder of what the puppet danced: train does not look into it
SHORTEST_S = 2.0
_SILENT_S = 0.3  # a stream that pauses for longer begins another recording
_LIGHTS = ("/lights", "/master", "/blackout", "/fixture", "/mapping")
_READ_ME = """\
A rehearsal, from the journal of Bunraku: {show}, {seconds:.0f} s.

live_*.bvh      what the live dancer danced: bunraku train --recordings . --out my_dancer
puppet/         what the puppet answered; not for training: a network that learns its own output forgets
hands.csv       each hand, 50 times a second: joint, weight 0 to 1, orientation w x y z
sensors.csv     each reading of a sensor: orientation w x y z, battery
cues.csv        cues and all other orders, by second
lights.csv      those of them that are about lights
"""


class TrainingSet(NamedTuple):
    """folder; recordings of a live dancer, and their seconds in all."""

    folder: Path
    recordings: int
    seconds: float

    def sentence(self) -> str:
        """Its contents, for people."""
        if not self.recordings:
            return (
                f"{self.folder}: no live dancer danced in this journal, so there is nothing to train on. "
                "Hands, sensors and cues are in it, and what the puppet danced."
            )
        return (
            f"{self.folder}: {counted(self.recordings, 'recording')} of the live dancer, "
            f"{self.seconds:.0f} s, with hands, sensors and cues. Train on it: bunraku train --recordings "
            f"{self.folder} --out my_dancer"
        )


def write_training_set(journal: JournalRecording, folder: Path) -> TrainingSet:
    """Write the newest run and those of the same figure into a new folder, whole or not at all.

    Raises JournalError where the folder has other files, OSError where it takes none.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise JournalError(f"{folder}: there is something already. Name a new folder.")
    newest = journal.runs[-1]
    runs = [run for run in journal.runs if run.ticks.dtype == newest.ticks.dtype]
    part = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        danced = [one for run in runs for one in live_dances(run)]
        for number, one in enumerate(danced, 1):
            write_recording(part / f"live_{number:02}.bvh", one)
        (part / PUPPET).mkdir()
        seconds = 0.0
        for number, run in enumerate(runs, 1):
            seconds += len(run.ticks) * run.header["tick_s"]
            for place, name in enumerate(run.puppets):
                called = "".join(letter for letter in name if letter.isalnum()) or "puppet"
                write_recording(part / PUPPET / f"{called}_{number:02}.bvh", _puppet(run, place))
        events = [(number, run, event) for number, run in enumerate(runs, 1) for _, event in run.events]
        _write_table(part / "hands.csv", ("run", "time", "joint", "weight", *"wxyz"), _hands(runs))
        _write_table(part / "sensors.csv", ("run", "time", "sensor", *"wxyz", "battery"), _sensors(runs))
        orders = list(_orders(events))
        _write_table(part / "cues.csv", ("run", "time", "kind", "what"), orders)
        lights = [row for row in orders if any(word in str(row[3]) for word in _LIGHTS)]
        _write_table(part / "lights.csv", ("run", "time", "kind", "what"), lights)
        words = f"A rehearsal of {newest.header['show']}."
        write_whole(part / "catalogue.yaml", f"acknowledgement: {json.dumps(words)}\n".encode())
        read_me = _READ_ME.format(show=newest.header["show"], seconds=seconds)
        write_whole(part / "README.txt", read_me.encode())
        if folder.exists():
            folder.rmdir()
        part.replace(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return TrainingSet(folder, len(danced), sum(one.seconds for one in danced))


def live_dances(run: Run) -> list[Recording]:
    """The live dancer's dance at the tick's rate, a recording for each uninterrupted stream.

    Joints that nothing said turn as they do in the stance.
    """
    ticks, tick_s = run.ticks, run.header["tick_s"]
    if not ticks["live_arrival"].size:
        return []
    here = np.flatnonzero(np.isfinite(ticks["live_arrival"][:, 0]))
    if not len(here):
        return []
    at, first = np.unique(ticks["live_arrival"][here, 0], return_index=True)
    rows = here[first]
    cuts = np.flatnonzero(np.diff(at) > _SILENT_S) + 1
    found = []
    for times, part in zip(np.split(at, cuts), np.split(rows, cuts), strict=True):
        if times[-1] - times[0] < SHORTEST_S:
            continue
        frames = np.arange(times[0], times[-1], tick_s)
        poses = _evenly(times, ticks["live_pose"][part].astype(float), frames, run.skeleton.standing)
        roots = _places(times, ticks["live_root"][part, 0].astype(float), frames)
        found.append(Recording(run.skeleton, poses, roots, 1.0 / tick_s))
    return found


def _evenly(times: Array, poses: Array, frames: Array, standing: Array) -> Array:
    """Poses (N, J, 4) at these times -> at even ones; not numbers: as before and after, or as it stands."""
    out = np.empty((len(frames), *poses.shape[1:]))
    for joint in range(poses.shape[1]):
        known = np.flatnonzero(np.isfinite(poses[:, joint]).all(axis=1))
        if not len(known):
            out[:, joint] = standing[joint]
            continue
        turns, at = quaternion.continuous(quaternion.normalize(poses[known, joint])), times[known]
        after = np.clip(np.searchsorted(at, frames), 1, max(len(at) - 1, 1)) if len(at) > 1 else None
        if after is None:
            out[:, joint] = turns[0]
            continue
        share = np.clip((frames - at[after - 1]) / (at[after] - at[after - 1]), 0.0, 1.0)
        out[:, joint] = quaternion.slerp(turns[after - 1], turns[after], share)
    return quaternion.continuous(quaternion.normalize(out))


def _places(times: Array, roots: Array, frames: Array) -> Array:
    found = np.zeros((len(frames), 3))
    for axis in range(3):
        known = np.isfinite(roots[:, axis])
        if known.any():
            found[:, axis] = np.interp(frames, times[known], roots[known, axis])
    return found


def _puppet(run: Run, place: int) -> Recording:
    ticks = run.ticks
    return Recording(
        run.skeleton, ticks["pose"][:, place], ticks["root"][:, place], 1.0 / run.header["tick_s"]
    )


def _hands(runs: Sequence[Run]) -> Iterable[tuple[object, ...]]:
    for number, run in enumerate(runs, 1):
        at = run.ticks["frame_time"] - run.ticks["frame_time"][0]
        for place, hand in enumerate(run.header["hands"]):
            weights, targets = run.ticks["weights"][:, place], run.ticks["targets"][:, place]
            for tick in np.flatnonzero(weights > 0.0):
                turned = (f"{value:.6f}" for value in targets[tick])
                yield number, f"{at[tick]:.3f}", hand["joint"], f"{weights[tick]:.4f}", *turned


def _sensors(runs: Sequence[Run]) -> Iterable[tuple[object, ...]]:
    for number, run in enumerate(runs, 1):
        begun = run.ticks["frame_time"][0]
        for place, name in enumerate(run.header["sensors"]):
            for tick in np.flatnonzero(run.ticks["reading_here"][:, place]):
                row = run.ticks[tick]
                turned = (f"{value:.6f}" for value in row["reading_orientation"][place])
                arrival = row["reading_times"][place, 1] - begun
                yield number, f"{arrival:.3f}", name, *turned, int(row["reading_numbers"][place, 2])


def _orders(events: Iterable[tuple[int, Run, dict[str, Any]]]) -> Iterable[tuple[object, ...]]:
    for number, run, event in events:
        at = event["now"] - float(run.ticks["frame_time"][0])
        yield number, f"{at:.3f}", event["kind"], message_of(event)


def _write_table(path: Path, titles: Sequence[str], rows: Iterable[tuple[object, ...]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(titles)
    writer.writerows(rows)
    write_whole(path, text.getvalue().encode())
