"""`bunraku periods`: two periods of a practice, and what each does that the other never does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from appliance.pictures.filmstrip import draw_rows
from appliance.pictures.filmstrip_stage import SLATE, Row
from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import named_show
from appliance.show.show import load_show
from appliance.studio.dance_files import write_report
from appliance.studio.data.catalogue import ALWAYS, Catalogue, find_catalogue
from appliance.studio.data.dataset import FPS, load_folder
from appliance.studio.data.takes import Take, load_take
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.evaluation.pictures import (
    FAINT,
    INK,
    PANEL,
    VERMILION,
    new_figure,
    panels,
    save,
)
from appliance.studio.evaluation.pictures import (
    SLATE as SLATE_LINE,
)
from appliance.studio.exchange.retargeting import retarget
from appliance.studio.improviser.naturalness import SECOND_S, distances, figure_shapes, seconds_of
from appliance.studio.improviser.naturalness import nearest as nearest_of
from appliance.studio.progress import doing, shown
from appliance.studio.studio_error import StudioError

EVERY = 10  # ticks from one second of dance to the next
USUAL_PERCENT = 90.0  # percent of a period's seconds that are as near as that to another take
BODY_CM = 170.0  # height of the body on which distances are measured
LEAST_SECONDS = 40  # seconds of dance of a period, at 0.2 s from one to the next: 9 s
PARTS_S = 10.0  # a period of one recording is cut into parts, two at least, each a take
MOST_NEW = 2000
FEWEST_ROLES = 8


@dataclass(frozen=True)
class PeriodsOptions:
    """The command line of bunraku periods. earlier, later: a folder of recordings, a BVH file, or a show."""

    earlier: Path
    later: Path
    out: Path
    count: int
    reading: ReadingOptions


@dataclass(frozen=True)
class Movement:
    """A second of dance that the other period has nothing like. times: how many seconds of its period are
    like it, in how many takes; away_cm: from the nearest second of the other period, which is at `nearest`.
    """

    take: str
    at_s: float
    times: int
    takes: int
    away_cm: float
    nearest: str
    nearest_s: float


@dataclass(frozen=True)
class Period:
    """All sound seconds of dance of some takes: rows (K, D), where each is, and which take it belongs to."""

    name: str
    takes: Sequence[Take]
    rows: Array
    owners: NDArray[np.intp]
    firsts: NDArray[np.intp]

    @staticmethod
    def of(name: str, takes: Sequence[Take], roles: Sequence[str] | None) -> Period:
        """roles: the joints that count; None: all that move. Raises StudioError where it is too short."""
        rows, owners, firsts = [], [], []
        for number, take in enumerate(takes):
            skeleton = take.recording.skeleton
            joints = range(len(skeleton)) if roles is None else [skeleton.roles[role] for role in roles]
            shapes = figure_shapes(take.recording, list(joints))
            shapes *= BODY_CM / (100 * Anatomy(skeleton).height)
            for first, end in take.sound_runs:
                found = seconds_of(shapes[first:end], EVERY)
                rows.append(found)
                owners += [number] * len(found)
                firsts += [first + EVERY * place for place in range(len(found))]
        whole = np.concatenate(rows) if rows else np.zeros((0, 1))
        if len(whole) < LEAST_SECONDS or len(set(owners)) < 2:  # nothing says what is usual between takes
            raise StudioError(f"{name} has less than 9 s of sound dance: too little to call a practice.")
        return Period(name, takes, whole, np.array(owners), np.array(firsts))

    def second_of(self, row: int) -> float:
        """The middle of a second of dance, in its recording."""
        begins = self.takes[self.owners[row]].begins_s
        return float(begins + self.firsts[row] / FPS + SECOND_S / 2)

    def to_other_takes(self) -> Array:
        """(K,): from each second to the nearest one of another take, cm."""
        found = np.empty(len(self.rows))
        for owner in np.unique(self.owners):
            own = self.owners == owner
            found[own], _ = nearest_of(self.rows[own], self.rows[~own])
        return found

    def between_halves(self) -> Array:
        """(K,): from each second to the nearest one of the other half of the takes, every second one: cm."""
        half = np.unique(self.owners, return_inverse=True)[1] % 2
        found = np.empty(len(self.rows))
        for side in (0, 1):
            found[half == side], _ = nearest_of(self.rows[half == side], self.rows[half != side])
        return found


def run(options: PeriodsOptions) -> None:
    """Read, compare, draw, write; raises StudioError, DatasetError, BvhError, ConfigError."""
    console = Console(stderr=True)
    both = []
    for path in (options.earlier, options.later):
        with doing(f"reading {path}", console):
            both.append((path.resolve().stem, _takes(path, options.reading)))
    if both[0][0] == both[1][0]:
        both = [
            (str(path), takes)
            for path, (_, takes) in zip((options.earlier, options.later), both, strict=True)
        ]
    roles = _roles([takes[0].recording.skeleton for _, takes in both])
    with doing("measuring each second of dance", console):
        one, other = (Period.of(name, takes, roles) for name, takes in both)
        usual = usual_cm(one, other)
        away = [nearest_of(a.rows, b.rows)[0] for a, b in ((one, other), (other, one))]
        nulls = [period.between_halves() for period in (one, other)]
    found = {
        period.name: movements(period, against, usual, options.count)
        for period, against in shown([(one, other), (other, one)], "finding the movements", console)
    }
    options.out.mkdir(parents=True, exist_ok=True)
    with doing("drawing periods.png and shares.png", console):
        _draw_movements(options.out / "periods.png", (one, other), found)
        _draw_shares(options.out / "shares.png", (one, other), away, nulls, usual)
    shares = {
        period.name: {"new": float((far > usual).mean()), "null_halves": float((half > usual).mean())}
        for period, far, half in zip((one, other), away, nulls, strict=True)
    }
    report = {
        "options": asdict(options),
        "usual_cm": usual,
        "shares": shares,
        "movements": {name: [asdict(each) for each in those] for name, those in found.items()},
    }
    write_report(options.out / "periods.json", report)
    for period, against in ((one, other), (other, one)):
        Console().print(_table(period, against, found[period.name]))
    for period, against in ((one, other), (other, one)):
        share = shares[period.name]
        console.print(
            f"{share['new']:.0%} of {period.name} is like nothing in {against.name}; of one half of "
            f"{period.name}, {share['null_halves']:.0%} is like nothing in the other half.",
            highlight=False,
            soft_wrap=True,
        )
    console.print(
        f"{options.out}: periods.png (the movements, the nearest of the other behind), shares.png, "
        "periods.json.",
        highlight=False,
        soft_wrap=True,
    )


def usual_cm(one: Period, other: Period) -> float:
    """How near two seconds are that count as the same movement: as takes of one period usually are."""
    return float(
        np.percentile(np.concatenate([each.to_other_takes() for each in (one, other)]), USUAL_PERCENT)
    )


def movements(period: Period, other: Period, usual: float, count: int) -> list[Movement]:
    """Movements that the other period has nothing like, the most frequent first, each with all alike."""
    away, nearest = nearest_of(period.rows, other.rows)
    new = np.flatnonzero(away > usual)
    new = new[:: max(1, len(new) // MOST_NEW)]
    alike = distances(period.rows[new], period.rows[new]) <= usual
    found, left = list[Movement](), np.ones(len(new), bool)
    while left.any() and len(found) < count:
        best = int((alike[:, left].sum(axis=1) * left).argmax())
        members = alike[best] & left
        members[best] = True
        at, near = new[best], nearest[new[best]]
        found.append(
            Movement(
                period.takes[period.owners[at]].name,
                period.second_of(int(at)),
                int(members.sum()),
                len(np.unique(period.owners[new[members]])),
                float(away[at]),
                other.takes[other.owners[near]].name,
                other.second_of(int(near)),
            )
        )
        left &= ~members
    return found


def _takes(path: Path, reading: ReadingOptions) -> list[Take]:
    """A show gives its phrases; a single recording is cut into parts that are compared with each other."""
    show = named_show(path) or path
    if (show / "show.yaml").is_file():
        kept = Catalogue(keep={"*": (ALWAYS,)})
        found = [load_take(file, kept) for file in load_show(show).phrases.values()]
    elif path.is_dir():
        found = list(load_folder(path, reading).takes)
    else:
        found = [load_take(path, find_catalogue(path.parent, [path]).with_options(reading))]
    if len({take.take for take in found}) > 1:
        return found
    parts = []
    for take in found:
        count = len(take.recording)
        length = min(round(PARTS_S * FPS), -(-count // 2))
        parts += [take.part(first, min(first + length, count)) for first in range(0, count, length)]
    return [replace(part, name=part.file) for part in parts]


def _roles(skeletons: Sequence[Skeleton]) -> list[str] | None:
    """The roles that both have; None where they have the same joints. Raises StudioError."""
    one, other = skeletons
    shared = [role for role in one.roles if role in other.roles]
    if len(shared) >= FEWEST_ROLES:
        return shared
    if one.same_joints(other):
        return None
    raise StudioError(
        "The two have different skeletons, and the names of their joints do not say what they are. See "
        "bunraku inspect; rename the joints, or bring both on one skeleton with bunraku retarget."
    )


def _pose_at(period: Period, take: str, at_s: float, skeleton: Skeleton) -> Recording:
    """One pose of a period, facing ahead, on a skeleton."""
    for one in period.takes:
        inside = at_s - one.begins_s
        if one.name == take and 0 <= inside < one.recording.seconds:
            pose = one.recording.excerpt(inside, inside + 1.5 / FPS)
            break
    else:
        raise LookupError(f"{take} has no second {at_s}")
    level = replace(pose, poses=without_heading(pose.poses)[:1], roots=pose.roots[:1], translations=None)
    return level if level.skeleton.same_joints(skeleton) else retarget(level, skeleton)


def _draw_movements(path: Path, both: tuple[Period, Period], found: dict[str, list[Movement]]) -> None:
    """A row for each period: its movements, and behind each the nearest of the other period."""
    skeleton, rows = both[0].takes[0].recording.skeleton, []
    for period, other in (both, both[::-1]):
        those = found[period.name]
        if not those:
            continue
        own = [_pose_at(period, each.take, each.at_s, skeleton) for each in those]
        near = [_pose_at(other, each.nearest, each.nearest_s, skeleton) for each in those]
        chosen = np.arange(len(those))
        poses, behind = (np.concatenate([one.poses for one in each]) for each in (own, near))
        roots, roots_behind = (np.concatenate([one.roots for one in each]) for each in (own, near))
        ghost = Row(quaternion.normalize(behind), roots_behind, chosen, colour=SLATE)
        stamps = tuple(f"{each.take}\n{each.at_s:.1f} s" for each in those)
        label = f"{period.name}, never in {other.name}"
        rows.append(Row(poses, roots, chosen, label, behind=ghost, stamps=stamps))
    if rows:
        draw_rows(path, skeleton, rows, FPS, "Movements that one has and the other never", "")


def _draw_shares(
    path: Path, both: tuple[Period, Period], away: Sequence[Array], nulls: Sequence[Array], usual: float
) -> None:
    """Which share of the seconds is farther than so many centimetres from the other period."""
    figure = new_figure(10.0, 4.0)
    (axes,) = panels(figure, 1, 1)
    for period, far, half, colour in zip(both, away, nulls, (VERMILION, SLATE_LINE), strict=True):
        for values, words, style in ((far, "from the other period", "-"), (half, "half from half", ":")):
            label = f"{period.name}, {words}: {(values > usual).mean():.0%}"
            rest = 1 - np.arange(1, len(values) + 1) / len(values)
            axes.plot(np.sort(values), rest, style, color=colour, linewidth=1.6, label=label)
    axes.axvline(usual, color=FAINT, linewidth=0.8)
    axes.set_xlabel("centimetres from the nearest second of dance", color=FAINT)
    axes.set_title("Share of the seconds that are farther away", color=INK, loc="left")
    axes.legend(facecolor=PANEL, edgecolor=PANEL, labelcolor=INK, fontsize=8)
    save(figure, path)


def _table(period: Period, other: Period, found: Sequence[Movement]) -> Table:
    table = Table(title=f"{period.name} does, {other.name} never does", box=SIMPLE_HEAD)
    for name, right in (
        ("movement", False),
        ("at", True),
        ("seconds", True),
        ("takes", True),
        ("away", True),
    ):
        table.add_column(name, justify="right" if right else "left", no_wrap=not right)
    table.add_column("nearest there")
    for one in found:
        table.add_row(
            one.take,
            f"{one.at_s:.1f} s",
            f"{one.times * EVERY / FPS:.1f}",
            str(one.takes),
            f"{one.away_cm:.0f} cm",
            f"{one.nearest} {one.nearest_s:.1f} s",
        )
    return table
