"""Is a show bundle complete and consistent? All checks that need no dancing."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from appliance.levers.sources import MAIN
from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.foreign_file import content, plain_json, require_inside
from appliance.pose.possible import FARTHEST_M, FASTEST_M_S, impossible_frames
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import (
    CHECKSUMS,
    COPY_AGAIN,
    bundle_bytes,
    checksum_problems,
    no_such_show,
    unlisted_files,
)
from appliance.show.config_error import ConfigError, Problem, bounded
from appliance.show.network import WINDOW, inspect_network
from appliance.show.show import Show, load_show

LARGEST_BYTES = 25_000_000
LARGEST_REPORT = 16_000_000
RATE_HZ = 50.0
OFFSET_TOLERANCE_M = 1e-3
_MOST_NAMED = 5  # frames in a message


@dataclass(frozen=True)
class Finding(Problem):
    """A finding of `bunraku check`: an error keeps the show off the stage, a warning does not."""

    level: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        return super().__str__() if self.level == "error" else f"{super().__str__()} (a warning)"

    @property
    def forbids_dancing(self) -> bool:
        """A show that was changed after it was packed can be danced; a box takes it from no stick."""
        return self.level == "error" and self.file.name != CHECKSUMS


def not_as_packed(directory: Path) -> str:
    """A sentence about a show that differs from its checksums; '' for one that matches."""
    if not checksum_problems(directory):
        return ""
    return (
        f"{directory} is not as it was packed. It is danced as it is; a box takes it from no stick. If you "
        f"changed it: bunraku pack {shlex.quote(str(directory))}. If not: copy the whole show again."
    )


def verify_bundle(directory: Path | str) -> list[Finding]:
    """All that is wrong with a bundle, errors first; empty for a sound one. Never raises for a bad one."""
    directory = Path(directory)
    if not directory.is_dir():
        return [_error(no_such_show(directory))]
    findings = [*_files(directory), *_show(directory)]
    levels = ("error", "warning")
    return [one for level in levels for one in bounded([found for found in findings if found.level == level])]


def _files(directory: Path) -> Iterator[Finding]:
    for problem in checksum_problems(directory):
        yield _error(problem)
    try:
        unlisted, size = unlisted_files(directory), bundle_bytes(directory)
    except OSError as error:
        yield Finding(
            directory, 0, f"This cannot be a show ({error.strerror}).", "Name the show's own folder."
        )
        return
    for name in unlisted:
        message = f"'{name}' has no checksum in {CHECKSUMS}."
        yield Finding(directory / name, 0, message, "Remove it, or pack the bundle again.", "warning")
    if size > LARGEST_BYTES:
        message = f"The bundle is {size / 1e6:.1f} MB, more than {LARGEST_BYTES / 1e6:g} MB."
        yield Finding(directory, 0, message, "Shorten the phrase, or quantize the network.", "warning")
    yield from _report(directory / "report.json")


def _report(path: Path) -> Iterator[Finding]:
    cure = "Evaluate and pack the show again."
    try:
        require_inside(path, path.parent)
        plain_json(content(path, LARGEST_REPORT))
    except FileNotFoundError:
        yield Finding(path, 0, "The report of the training is missing.", cure, "warning")
    except OSError as error:
        yield Finding(path, 0, f"The report cannot be read ({error.strerror}).", cure, "warning")
    except ValueError as error:
        yield Finding(path, getattr(error, "lineno", 1), "The report is not JSON.", cure, "warning")


def _show(directory: Path) -> Iterator[Finding]:
    try:
        show = load_show(directory)
    except ConfigError as error:
        yield from map(_error, error.problems)
        return
    yield from _bones(show)
    joints, complaints = inspect_network(show.network, show.skeleton.names)
    for message, cure in complaints:
        yield Finding(show.network, 0, message, cure)
    if joints:
        try:
            show.require_moving(joints)
        except ConfigError as error:
            yield from map(_error, error.problems)
    for problem in (*show.doubtful_hands(), *show.doubtful_strings()):
        yield Finding(problem.file, problem.line, problem.message, problem.cure, "warning")
    for name, path in show.phrases.items():
        yield from _phrase(show, name, path)


def _bones(show: Show) -> Iterator[Finding]:
    """Bones that are longer than any stage: their figure would never leave the box."""
    for joint, offset in zip(show.skeleton.names, show.skeleton.offsets, strict=True):
        if not np.abs(offset).max() <= FARTHEST_M:
            message = f"The joint '{joint}' is {np.abs(offset).max():.3g} m from the one above it."
            cure = "Mend its OFFSET, and pack the phrases with that skeleton."
            yield Finding(show.directory / "skeleton.bvh", 0, message, cure)


def _phrase(show: Show, name: str, path: Path) -> Iterator[Finding]:
    try:
        phrase = read_bvh(path)
    except BvhError as error:
        yield Finding(path, error.line, str(error).split(": ", 1)[-1], COPY_AGAIN)
        return
    except OSError as error:
        yield Finding(path, 0, f"The phrase cannot be read ({error.strerror}).", COPY_AGAIN)
        return
    for note in phrase.notes:
        yield Finding(path, 0, f"{note[0].upper()}{note[1:]}.", COPY_AGAIN, "warning")
    yield from _phrase_skeleton(path, phrase.skeleton, show.skeleton)
    if abs(phrase.fps - RATE_HZ) > 0.1:
        message = (
            f"The phrase has {phrase.fps:.4g} poses a second and is resampled to {RATE_HZ:g} at each start."
        )
        yield Finding(path, 0, message, "Pack it at 50 Hz.", "warning")
    yield from _phrase_path(path, phrase)
    if name == MAIN:
        yield from _excerpt(show, phrase)
    elif len(phrase) * RATE_HZ / phrase.fps < WINDOW:
        message = f"The phrase '{name}' has {len(phrase)} poses; one window needs {WINDOW}."
        yield Finding(path, 0, message, "Use a longer phrase.")


def _phrase_skeleton(path: Path, found: Skeleton, wanted: Skeleton) -> Iterator[Finding]:
    cure = "Pack the phrase with the skeleton of the show."
    if found.same_joints(wanted):
        if np.abs(found.offsets - wanted.offsets).max() > OFFSET_TOLERANCE_M:
            yield Finding(path, 0, "The phrase's bones are not as long as those of skeleton.bvh.", cure)
        return
    other = sorted(set(found.names) ^ set(wanted.names))
    which = f"only one of them has {', '.join(other[:5])}" if other else "their order or parents differ"
    yield Finding(path, 0, f"The phrase has other joints than skeleton.bvh: {which}.", cure)


def _phrase_path(path: Path, phrase: Recording) -> Iterator[Finding]:
    """Frames to which the root jumps: the dance goes on from where it stood."""
    frames = impossible_frames(phrase.roots, phrase.fps)
    if not len(frames):
        return
    named = ", ".join(f"{frame + 1} ({frame / phrase.fps:.2f} s)" for frame in frames[:_MOST_NAMED])
    more = f" and {len(frames) - _MOST_NAMED} more" if len(frames) > _MOST_NAMED else ""
    message = (
        f"The root jumps farther than {FASTEST_M_S:g} m/s in frame{'s' * (len(frames) > 1)} {named}{more}: "
        "these steps are left out, and the figure goes on from where it stood."
    )
    yield Finding(path, 0, message, "Mend the capture, or cut the phrase there.", "warning")


def _excerpt(show: Show, phrase: Recording) -> Iterator[Finding]:
    """The excerpt that show.yaml asks for must lie within the phrase and fill one window."""
    motion, lines = show.config.motion, show.file
    if motion.end_s is not None and motion.end_s > phrase.seconds + 1 / RATE_HZ:
        message = f"end_s ({motion.end_s:g}) is behind the phrase's end ({phrase.seconds:.2f} s)."
        yield Finding(lines.path, lines.line(("motion", "end_s")), message, "Write an earlier end, or null.")
    excerpt = phrase.excerpt(motion.start_s, motion.end_s)
    if len(excerpt) * RATE_HZ / phrase.fps < WINDOW:
        message = f"The excerpt has {len(excerpt)} poses; one window needs {WINDOW}."
        where = lines.line(("motion", "start_s")) if motion.start_s or motion.end_s else 0
        file = lines.path if where else show.phrase
        yield Finding(file, where, message, "Use a longer phrase, or a wider start_s and end_s.")


def _error(problem: Problem) -> Finding:
    return Finding(problem.file, problem.line, problem.message, problem.cure)
