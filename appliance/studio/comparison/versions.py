"""`bunraku compare`: a student's version of a dance beside the teacher's, aligned in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from appliance.dancer.loop import turns_about_y, yaws
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.studio.comparison.alignment import Alignment, align
from appliance.studio.comparison.pictures import draw_joints_over_time, draw_moments
from appliance.studio.dance_files import write_report
from appliance.studio.data.catalogue import find_catalogue
from appliance.studio.data.dataset import FPS
from appliance.studio.data.mirror import asymmetry, mirrored
from appliance.studio.data.takes import load_take
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.exchange.retargeting import retarget
from appliance.studio.progress import doing
from appliance.studio.studio_error import StudioError

MOMENTS, MOMENTS_APART_S = 6, 1.5
SMOOTH_S = 0.3  # the joints' differences are smoothed before the worst moments are chosen
TOGETHER_S, SAME_TEMPO, SAME_FORM_DEGREES = 0.1, 0.02, 5.0
OTHER_DANCE_DEGREES = 15.0  # two takes of one dancer, aligned: 19 to 26 degrees
MIRRORED_FITS = 0.7  # fraction of the difference; less means that the student is probably the mirror image
SHIFT_S, FASTER = 0.4, 1.1  # how the teacher's copies differ, with which the figures are compared


@dataclass(frozen=True)
class CompareOptions:
    """The command line of bunraku compare."""

    teacher: Path
    student: Path
    out: Path
    is_mirrored: bool = False
    start: float = 0.0
    seconds: float = 120.0
    nulls: bool = True
    reading: ReadingOptions = AS_THE_FILES_SAY


@dataclass(frozen=True)
class Moment:
    """A place where the two differ: second of the teacher and of the student, the joint that differs most,
    degrees, and in words where the end of its bone is.
    """

    tick: int
    teacher_s: float
    student_s: float
    joint: str
    degrees: float
    words: str


@dataclass(frozen=True)
class Comparison:
    """Two versions of a dance. teacher, student: on the teacher's ticks that have a counterpart, with one
    skeleton; joints: those compared; degrees (N, M): apart at each tick; on_the_clock: mean degrees apart
    without the alignment.
    """

    teacher: Recording
    student: Recording
    joints: tuple[int, ...]
    alignment: Alignment
    degrees: Array
    on_the_clock: float
    compared: float  # share of the teacher's dance that has a counterpart

    @property
    def form(self) -> float:
        """Mean joint angle between them after the alignment, degrees."""
        return float(self.degrees.mean())

    @cached_property
    def by_joint(self) -> dict[str, float]:
        """The same of each joint, the worst one first."""
        means = self.degrees.mean(axis=0)
        return {self.name(place): float(means[place]) for place in np.argsort(-means)}

    def name(self, place: int) -> str:
        """The role of a compared joint, else its name, which another joint may have as its role."""
        joint, roles = self.joints[place], self.teacher.skeleton.roles
        own = self.teacher.skeleton.names[joint]
        known = next((role for role, one in roles.items() if one == joint), None)
        return known or (f"joint {own}" if own in roles else own)

    def moments(self) -> list[Moment]:
        """Where they differ most, the worst one first."""
        frames = max(1, round(SMOOTH_S * FPS))
        smooth = np.apply_along_axis(np.convolve, 0, self.degrees, np.ones(frames) / frames, "same")
        together, found = np.sqrt((smooth**2).mean(axis=1)), list[Moment]()
        while len(found) < MOMENTS and together.max() > 0.5:
            tick = int(together.argmax())
            apart = round(MOMENTS_APART_S * FPS)
            together[max(0, tick - apart) : tick + apart] = 0.0
            found.append(self._moment(tick, int(smooth[tick].argmax())))
        return found

    def _moment(self, tick: int, place: int) -> Moment:
        at = self.alignment
        return Moment(
            tick,
            (at.first + tick) / FPS,
            float(at.ticks[tick]) / FPS,
            self.name(place),
            float(self.degrees[tick, place]),
            self._where(tick, self.joints[place]),
        )

    def _where(self, tick: int, joint: int) -> str:
        """Where the student has the far end of a joint's bone, from the joint, in words: '22 cm lower'."""
        skeleton = self.teacher.skeleton
        child = next((each for each, parent in enumerate(skeleton.parents) if parent == joint), None)
        offset = (
            next((np.array(end) for each, end in skeleton.ends if each == joint), None)
            if child is None
            else skeleton.offsets[child]
        )
        if offset is None or joint == 0:
            return ""
        ways = []
        for dance in (self.teacher, self.student):
            pose = without_heading(dance.poses[tick])
            _, world = skeleton.forward_kinematics(pose, np.zeros(3))
            ways.append(quaternion.rotate(world[joint], offset))
        off = 100 * (ways[1] - ways[0])
        words = (("further left", "further right"), ("higher", "lower"), ("further forward", "further back"))
        most = int(np.abs(off).argmax())
        return f"{abs(off[most]):.0f} cm {words[most][int(off[most] < 0)]}" if abs(off[most]) >= 2 else ""


def run(options: CompareOptions) -> None:
    """Align, measure, draw, write; raises StudioError, BvhError, DatasetError."""
    console = Console(stderr=True)
    with doing("reading both recordings", console):
        teacher, student = (_excerpt(file, options) for file in (options.teacher, options.student))
        student = _mirrored(student, options.student) if options.is_mirrored else student
    with doing("aligning them in time", console):
        found = compare(teacher, student)
        other_way = None if options.is_mirrored else _mirrored_form(teacher, student)
    rows = {options.student.stem: found}
    if options.nulls:
        with doing("comparing the teacher with copies, shifted, faster, mirrored and backwards", console):
            rows |= dict(null_rows(teacher))
    moments = found.moments()
    options.out.mkdir(parents=True, exist_ok=True)
    names = options.teacher.stem, options.student.stem
    with doing("drawing moments.png and joints.png", console):
        draw_joints_over_time(options.out / "joints.png", found, moments, *names)
        draw_moments(options.out / "moments.png", found, moments, *names)
    words = sentences(found, moments, names[1])
    report: dict[str, Any] = {
        "options": asdict(options),
        "sentences": words,
        "figures": {name: figures(one) for name, one in rows.items()},
        "joints_degrees": found.by_joint,
        "moments": [asdict(one) for one in moments],
    }
    write_report(options.out / "compare.json", report)
    Console().print(_table(rows, found))
    for line in words:
        console.print(line, highlight=False, soft_wrap=True)
    if other_way is not None and other_way < MIRRORED_FITS * found.form:
        console.print(
            f"Mirrored, the student fits better ({other_way:.1f} degrees): give --mirrored.",
            highlight=False,
            soft_wrap=True,
        )
    console.print(
        f"{options.out}: moments.png (both figures where they differ most), joints.png (each joint over "
        "time), compare.json.",
        highlight=False,
        soft_wrap=True,
    )


def compare(teacher: Recording, student: Recording) -> Comparison:
    """Two recordings at 50 Hz; of another skeleton, the student's dance is put on the teacher's first.

    Raises StudioError where the skeletons have no joints in common that can be told.
    """
    joints = _joints(teacher, student)
    if not student.skeleton.same_joints(teacher.skeleton):
        student = retarget(student, teacher.skeleton)
    one, other = (without_heading(each.poses[:, joints]) for each in (teacher, student))
    alignment = align(one, other)
    count = len(alignment.ticks)
    part = slice(alignment.first, alignment.first + count)
    alike = student.between(alignment.ticks)
    degrees = np.degrees(quaternion.angle_between(one[part], without_heading(alike.poses[:, joints])))
    both = min(len(one), len(other))
    clock = np.degrees(quaternion.angle_between(one[:both], other[:both])).mean()
    known = replace(teacher, poses=teacher.poses[part], roots=teacher.roots[part], translations=None)
    shown = replace(_turned_alike(alike, known), translations=None)
    return Comparison(known, shown, tuple(joints), alignment, degrees, float(clock), count / len(teacher))


def null_rows(teacher: Recording) -> Iterator[tuple[str, Comparison]]:
    """The teacher beside copies whose difference is known; backwards, the same poses are another dance."""
    count = len(teacher)
    late = np.clip(np.arange(count + SHIFT_S * FPS) - SHIFT_S * FPS, 0, count - 1)
    copies = {
        "the teacher itself": teacher,
        f"itself {SHIFT_S:g} s later": teacher.between(late),
        f"itself {FASTER:g} times as fast": teacher.between(np.arange(0, count - 1, FASTER)),
        "itself, mirrored": _or_none(teacher),
        "itself, backwards": replace(teacher, poses=teacher.poses[::-1], roots=teacher.roots[::-1]),
    }
    for name, copy in copies.items():
        if copy is not None:
            yield name, compare(teacher, copy)


def figures(found: Comparison) -> dict[str, float]:
    """For a report."""
    at = found.alignment
    return {
        "on_the_clock_degrees": found.on_the_clock,
        "form_degrees": found.form,
        "late_s": at.late_s,
        "late_at_first_s": at.late_at_first_s,
        "tempo": at.tempo,
        "unsteady_s": at.unsteady_s,
        "compared": found.compared,
    }


def sentences(found: Comparison, moments: Sequence[Moment], name: str) -> list[str]:
    """Timing, form and the worst moments, for people."""
    at = found.alignment
    steady = abs(at.tempo - 1) < SAME_TEMPO
    late = at.late_s if steady else at.late_at_first_s
    tempo = "at the same tempo" if steady else f"{at.tempo:.2f} times as fast"
    when = "together with the teacher" if abs(late) < TOGETHER_S else f"{abs(late):.2f} s {_later(late)}"
    begins = "" if steady else "begins "
    unsteady = f", early and late by {at.unsteady_s:.2f} s" if at.unsteady_s >= TOGETHER_S else ""
    alike = "the form differs"
    if found.form < SAME_FORM_DEGREES:
        alike = "the form is the same"
    elif found.form > OTHER_DANCE_DEGREES:
        alike = "this is another dance, or another part of it"
    worst = list(found.by_joint.items())[:2]
    lines = [
        f"Timing: {name} {begins or 'is '}{when}, {tempo}{unsteady}.",
        f"Form: {alike}: {found.form:.1f} degrees a joint when aligned ({found.on_the_clock:.1f} on the "
        f"clock), most of all {' and '.join(f'{joint} ({value:.0f})' for joint, value in worst)}.",
    ]
    if moments:
        named = "; ".join(
            f"{one.teacher_s:.1f} s {one.joint} {one.degrees:.0f} degrees{one.words and f' ({one.words})'}"
            for one in moments[:3]
        )
        lines.append(f"The worst moments: {named}.")
    return lines


def _later(seconds: float) -> str:
    return "later" if seconds > 0 else "earlier"


def _excerpt(file: Path, options: CompareOptions) -> Recording:
    take = load_take(file, find_catalogue(file.parent, [file]).with_options(options.reading))
    recording = take.recording
    if options.start >= recording.seconds:
        raise StudioError(
            f"{file} is {recording.seconds:.1f} s long: --start {options.start:g} is not in it."
        )
    found = recording.excerpt(options.start, options.start + options.seconds)
    if found.seconds < 2.0:
        raise StudioError(f"{file} has {found.seconds:.1f} s there. Two seconds are the least to compare.")
    return found


def _joints(teacher: Recording, student: Recording) -> list[int]:
    """The teacher's joints that move in either and that both have. Raises StudioError."""
    moving = _moving(teacher)
    if student.skeleton.same_joints(teacher.skeleton):
        return sorted(moving | _moving(student))
    theirs = student.skeleton.roles
    shared = {joint for role, joint in teacher.skeleton.roles.items() if role in theirs}
    if len(shared) < 8:
        raise StudioError(
            "The two have different skeletons, and the names of their joints do not say what they are. See "
            "bunraku inspect; rename the joints, or bring both on one skeleton with bunraku retarget."
        )
    return sorted(moving & shared | {0})


def _moving(recording: Recording) -> set[int]:
    apart = np.degrees(quaternion.angle_between(recording.poses, recording.poses[:1])).max(axis=0)
    return {0, *np.flatnonzero(apart > 1.0).tolist()}


def _turned_alike(student: Recording, teacher: Recording) -> Recording:
    """The student turned so that it faces as the teacher, in the mean."""
    apart = yaws(quaternion.heading(teacher.poses[:, 0])) - yaws(quaternion.heading(student.poses[:, 0]))
    turn = turns_about_y(np.array(np.angle(np.exp(1j * apart).mean())))
    poses = student.poses.copy()
    poses[:, 0] = quaternion.multiply(np.broadcast_to(turn, poses[:, 0].shape), poses[:, 0])
    return replace(student, poses=poses)


def _mirrored(recording: Recording, file: Path) -> Recording:
    found = _or_none(recording)
    if found is None:
        raise StudioError(f"{file} cannot be mirrored: its joints' names do not say which side they are on.")
    return found


def _or_none(recording: Recording) -> Recording | None:
    """The mirror image, if the body has one."""
    return None if asymmetry(recording.skeleton, sorted(_moving(recording))) else mirrored(recording)


def _mirrored_form(teacher: Recording, student: Recording) -> float | None:
    image = _or_none(student)
    return None if image is None else compare(teacher, image).form


def _table(rows: dict[str, Comparison], found: Comparison) -> Table:
    table = Table(title="Versions of the dance beside the teacher's", box=SIMPLE_HEAD)
    table.add_column(no_wrap=True)
    for name in ("on the clock", "form", "later by", "tempo", "unsteady"):
        table.add_column(name, justify="right")
    for name, one in rows.items():
        at = one.alignment
        table.add_row(
            name,
            f"{one.on_the_clock:.1f}°",
            f"{one.form:.1f}°",
            f"{at.late_at_first_s:+.2f} s",
            f"{at.tempo:.2f}",
            f"{at.unsteady_s:.2f} s",
        )
    return table
