"""`bunraku duet`: trains a show's partner on couples, and measures it on couples that it never saw."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.motion_network import MotionNetworkError
from appliance.dancer.material.partner_network import PartnerNetwork
from appliance.pictures.filmstrip import draw_rows
from appliance.pictures.filmstrip_stage import SLATE
from appliance.pictures.filmstrip_stage import Row as Strip
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.show import Show, load_show
from appliance.studio.dance_files import write_report
from appliance.studio.data.dataset import FPS, Dataset, Take, load_folder
from appliance.studio.data.jumps import runs
from appliance.studio.data.mirror import mirror_pairs
from appliance.studio.evaluation.accord import Accord
from appliance.studio.evaluation.critic import critic
from appliance.studio.evaluation.dependence import dependence, likeness, share_led_by_second
from appliance.studio.evaluation.limbs import limb_figures, limbs_of
from appliance.studio.partner.couples import couples_of, stretches_of
from appliance.studio.partner.duet import LEAD_IN, danced_duet
from appliance.studio.partner.export import FILE, export_partner
from appliance.studio.partner.training import train
from appliance.studio.studio_error import StudioError

LEAST_S = 11.0  # shorter couples are alike by chance
LEAST_TICKS = 200  # length of a stretch from which accord is learned
COPY_LATE = 25  # ticks by which the null product copies
FOLLOWS_NAME, STRANGERS_NAME = "follow 1, lead 0", "the same beside dancers of other couples (null)"
COPY_NAME = f"a copy {COPY_LATE / 50:g} s later (null)"
STANDS = 0.3  # fraction of a dancer's energy
LISTENS, LEAST_DEPENDENCE = 2.0, 0.005  # times a stranger's dependence, and above it
DRAWN, COLUMNS = (1.0, 0.5, 0.0), 8  # values of follow that have a strip; figures in it
MANY = 8  # couples, two of which say which networks are best
_FOLLOWS, _LEADS = (1.0, 0.75, 0.5, 0.25, 0.0), (0.25, 0.5, 0.75, 1.0)
Pairs = Sequence[tuple[Take, Take]]


@dataclass(frozen=True)
class DuetOptions:
    """Recordings to measure, and minutes of training before that; 0: none."""

    recordings: Path
    show: Path
    minutes: float
    steps: int
    seconds: float
    seed: int
    out: Path | None
    reading: ReadingOptions


@dataclass(frozen=True)
class Row:
    """A kind of duet: how much the second dancer depends on the first, and so on; see docs/partner.md.

    error: the standard error of accord.
    """

    name: str
    dependence: float
    lag_s: float
    leads: float
    likeness: float
    critic: float = float("nan")
    energy: float = float("nan")
    accord: float = float("nan")
    error: float = float("nan")


def run(options: DuetOptions, device: str = "cpu") -> list[Row]:
    """Raises StudioError, ConfigError, DatasetError."""
    console = Console(stderr=True)
    show, dataset = load_show(options.show), load_folder(options.recordings, options.reading)
    apart = list(couples_of(dataset.held_out).values())
    if not apart:
        raise StudioError(
            "No couple is kept apart: two recordings of one take that the catalogue holds out. List takes "
            "and held_out in catalogue.yaml (docs/training.md)."
        )
    short = [one.take for one, _ in apart if one.recording.seconds < LEAST_S]
    apart = [both for both in apart if both[0].take not in short]
    if short:
        message = f"Couples shorter than {LEAST_S:g} s cannot be measured: {', '.join(short)}."
        if not apart:
            raise StudioError(f"{message} Hold longer ones out.")
        console.print(message, highlight=False)
    network = _improviser(show)
    if options.minutes or options.steps:
        _train(network, dataset, show.directory / FILE, options, console, device)
    try:
        partner = PartnerNetwork(show.directory / FILE, show.skeleton.names)
    except (MotionNetworkError, OSError) as error:
        raise StudioError(f"{show.directory / FILE}: {error} Train one: --minutes 5.") from None
    duets = {"recorded": (apart[0][0].recording, apart[0][1].recording)}
    rows = list(_rows(network, partner, dataset, apart, options, console.print, duets))
    _print(rows)
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_report(options.out, [row.__dict__ for row in rows])
        console.print("draws the first couple")
        draw_duets(options.out.with_suffix(".png"), duets, options.seconds)
        console.print(
            f"{options.out} has the figures, {options.out.with_suffix('.png').name} the first couple."
        )
    return rows


def _improviser(show: Show) -> ImproviserNetwork:
    try:
        return ImproviserNetwork(show.improviser, show.skeleton.names)
    except (MotionNetworkError, OSError) as error:
        raise StudioError(
            f"{show.improviser}: {error} A partner dances as the show's improviser does: train one with "
            "bunraku train --model improviser."
        ) from None


def _train(
    network: ImproviserNetwork,
    dataset: Dataset,
    path: Path,
    options: DuetOptions,
    console: Console,
    device: str,
) -> None:
    """The last couple of the training takes, or the last two of many, say which networks are best."""
    console.print("Couples become steps.")
    takes = sorted(couples_of(dataset.training))
    if len(takes) < 2:
        raise StudioError("It takes two couples that are not kept apart to train a partner.")
    asked = takes[-2:] if len(takes) >= MANY else takes[-1:]
    training, apart = (
        stretches_of(
            network, dataset, [take for take in dataset.training if (take.take in asked) == is_asked]
        )
        for is_asked in (False, True)
    )
    if not training or not apart:
        raise StudioError("The couples have no sound stretch of 3 s, or only one of them has.")
    seconds, steps = (60.0 * options.minutes, 10**9) if options.minutes else (float("inf"), options.steps)
    dancers = 4 if dataset.mirrors else 2
    partner = train(network, training, apart, dancers, seconds, steps, device, options.seed, console.print)
    export_partner(partner, network, path)
    console.print(f"{path} is written. For a box: bunraku pack {shlex.quote(str(path.parent))}.")


def _rows(
    network: ImproviserNetwork,
    partner: PartnerNetwork,
    dataset: Dataset,
    apart: Pairs,
    options: DuetOptions,
    report: Callable[[str], None],
    danced: dict[str, tuple[Recording, Recording]],
) -> Iterator[Row]:
    """danced: takes the first couple's duets by their names."""
    joints, moving = dataset.moving_names, list(dataset.moving)
    pairs = _counterparts(dataset.skeleton, moving)
    couples = [one for pair in apart for one in (pair, pair[::-1])]
    whole = {take.name: _seen(take.recording, moving) for pair in couples for take in pair}
    accords = _accords(dataset, moving)

    def row(name: str, both: Sequence[tuple[Array, Array]], recorded: Sequence[Take] = ()) -> Row:
        found = [dependence(one, two, joints) for one, two in both]
        above, lag_s, leads, alike = (
            float(np.mean(values))
            for values in (
                [one.above for one in found],
                [one.lag_s for one in found],
                [share_led_by_second(one, two, joints) for one, two in both],
                [likeness(one, two, pairs) for one, two in both],
            )
        )
        critic = energy = float("nan")
        if recorded:
            made, real = [two for _, two in both], [whole[take.name] for take in recorded]
            critic = _critic(recorded, made, moving)
            limbs = limbs_of(joints)
            energies = [
                value
                for one, two in zip(made, real, strict=True)
                for name, value in limb_figures(one, two, limbs).items()
                if name.startswith("energy")
            ]
            known = [value for value in energies if np.isfinite(value)]  # not of limbs that always stand
            energy = float(np.mean(known)) if known else float("nan")
        # The first of a couple leads in every other duet; in all where there is one for each couple.
        roles = [n % 2 if len(both) == len(couples) else 0 for n in range(len(both))]
        accord = [accords[role](*one) for role, one in zip(roles, both, strict=True)]
        error = float(np.std(accord) / np.sqrt(max(1, len(accord) - 1)))
        return Row(name, above, lag_s, leads, alike, critic, energy, float(np.mean(accord)), error)

    yield row("recorded couples", [(whole[one.name], whole[two.name]) for one, two in apart])
    others = couples[2:] + couples[:2]
    if len(apart) > 1:
        shuffled = [
            (whole[one.name], whole[two.name]) for (one, _), (_, two) in zip(couples, others, strict=True)
        ]
        yield row("dancers of different couples (null)", shuffled)
    copies = [(whole[one.name], np.roll(whole[one.name], COPY_LATE, 0)) for one, _ in apart]
    yield row(COPY_NAME, copies)
    dials = [(follow, 0.0) for follow in _FOLLOWS] + [(1.0, lead) for lead in _LEADS]
    for follow, lead in dials:
        report(f"dances with follow {follow:g}, lead {lead:g}")
        duets = [
            danced_duet(
                network,
                partner,
                _beginning(led.recording, options.seconds),
                own.recording,
                follow,
                lead,
                seed=options.seed,
            )
            for led, own in couples
        ]
        seen = [(_seen(one, moving)[LEAD_IN:], _seen(two, moving)[LEAD_IN:]) for one, two in duets]
        name = f"follow {follow:g}, lead {lead:g}"
        if follow in DRAWN and not lead:
            danced[name] = duets[0]
        yield row(name, seen, [own for _, own in couples])
        if (follow, lead) == (1.0, 0.0) and len(apart) > 1:
            wrong = seen[2:] + seen[:2]
            yield row(
                STRANGERS_NAME,
                [(other[0], own[1]) for other, own in zip(wrong, seen, strict=True)],
            )


def draw_duets(path: Path, duets: Mapping[str, tuple[Recording, Recording]], seconds: float) -> None:
    """A strip of each duet, its first dancer behind, over the seconds in which the second one answers."""
    chosen = np.linspace(LEAD_IN, LEAD_IN + seconds * FPS - 1, COLUMNS).round().astype(int)
    rows = []
    for name, (first, second) in duets.items():
        at = np.minimum(chosen, min(len(first), len(second)) - 1)
        rows.append(
            Strip(
                second.poses, second.roots, at, name, behind=Strip(first.poses, first.roots, at, colour=SLATE)
            )
        )
    draw_rows(path, second.skeleton, rows, FPS, path.stem, "")


def _counterparts(skeleton: Skeleton, moving: Sequence[int]) -> list[int]:
    """For each moving joint the place of its counterpart; its own where that never moves."""
    others = mirror_pairs(skeleton).tolist()
    return [
        moving.index(other if other in moving else joint)
        for joint, other in ((joint, others[joint]) for joint in moving)
    ]


def _unknown(first: Array, second: Array) -> float:
    return float("nan")


def _accords(dataset: Dataset, moving: Sequence[int]) -> Sequence[Callable[[Array, Array], float]]:
    """Accord with the first of a couple, and with the second; unknown where no couple was learned from."""
    sound = []
    for first, second in couples_of(dataset.training).values():
        for start, end in runs(first.sound & second.sound):
            if end - start >= LEAST_TICKS:
                sound.append([_seen(one.recording, moving)[start:end] for one in (first, second)])
    if not sound:
        return [_unknown, _unknown]
    return [Accord([(one, two) for one, two in sound]), Accord([(two, one) for one, two in sound])]


def _critic(recorded: Sequence[Take], made: Sequence[Array], moving: Sequence[int]) -> float:
    """The critic's value for the dances beside the dancers' own, in which only sound stretches count."""
    real, danced, names = [], [], []
    for take, dance in zip(recorded, made, strict=True):
        stretches = runs(take.sound[: len(dance) + LEAD_IN])
        real += [_seen(take.recording, moving)[start:end] for start, end in stretches]
        danced += [dance, *([dance[:0]] * (len(stretches) - 1))]
        names += [take.take] * len(stretches)
    return critic(real, danced, list(range(len(moving))), names)


def _beginning(recording: Recording, seconds: float) -> Recording:
    return recording.excerpt(0.0, min(seconds + LEAD_IN / 50, recording.seconds))


def _seen(recording: Recording, moving: Sequence[int]) -> Array:
    """Poses (T, M, 4) without headings."""
    poses = np.array(recording.poses[:, list(moving)], dtype=float)
    poses[:, 0] = quaternion.multiply(quaternion.inverse(quaternion.heading(poses[:, 0])), poses[:, 0])
    return poses


def _print(rows: Sequence[Row]) -> None:
    table = Table(
        "duet", "accord", "+-", "depends", "later by, s", "second leads", "likeness", "critic", "energy"
    )
    for row in rows:
        values = (
            *(row.accord, row.error, row.dependence, row.lag_s),
            *(row.leads, row.likeness, row.critic, row.energy),
        )
        digits = (3, 3, 3, 1, 2, 2, 2, 2)
        table.add_row(
            row.name,
            *("" if value != value else f"{value:.{n}f}" for value, n in zip(values, digits, strict=True)),
        )
    Console().print(table)
    real, own = rows[0].accord, _named(rows, FOLLOWS_NAME).accord
    print(f"The partner dances in accord with the other dancer by {own:.3f}; recorded couples by {real:.3f}.")
    print(what_is_dead(rows))


def what_is_dead(rows: Sequence[Row]) -> str:
    """Whether the partner stands, copies, does not listen, or answers: a sentence."""
    partner, copied = _named(rows, FOLLOWS_NAME), _named(rows, COPY_NAME)
    if partner.energy < STANDS:
        return f"The partner moves with {partner.energy:.2f} of the dancers' energy: it is a statue."
    if partner.likeness < (1 + copied.likeness) / 2:
        return "The partner copies the other dancer, or is its mirror image."
    strangers = [row.dependence for row in rows if row.name == STRANGERS_NAME] or [0.0]
    if partner.dependence < max(LISTENS * strangers[0], strangers[0] + LEAST_DEPENDENCE):
        return (
            "The partner does not listen: it depends on the other dancer hardly more than on a stranger. "
            "Measure longer duets (--seconds) to be sure, or train it longer or on more couples."
        )
    return "The partner answers: it moves, it does not copy, and it depends on the other dancer."


def _named(rows: Sequence[Row], name: str) -> Row:
    return next(row for row in rows if row.name == name)
