"""`bunraku experiment`: all families on five excerpts, with strips, recordings, figures and a page."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appliance.pictures.filmstrip import draw_strips
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.foreign_file import opened_text
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.roles import held_joints
from appliance.show.show import load_show
from appliance.studio.dance_files import write_report
from appliance.studio.data.catalogue import recordings_in
from appliance.studio.data.dataset import FPS, Take, load_folder
from appliance.studio.data.remembered import remembered_reading
from appliance.studio.evaluation.coders import Coder, open_coder
from appliance.studio.evaluation.evaluation import load_takes
from appliance.studio.experiments.claims import Claim, claims, verdict, worth
from appliance.studio.experiments.claims_picture import draw_claims
from appliance.studio.experiments.excerpts import Excerpt, choose, named
from appliance.studio.experiments.families import CONDITIONS, Trial, usual_trace
from appliance.studio.experiments.null_networks import KINDS, null_networks
from appliance.studio.experiments.page import write_page
from appliance.studio.experiments.strips import FIGURES, strip_of_excerpts, strips_of_trial
from appliance.studio.progress import reported
from appliance.studio.studio_error import StudioError

TITLE = "Experiments with a puppet"


@dataclass(frozen=True)
class ExperimentOptions:
    """The options that were given; None: the usual ones."""

    show: Path
    out: Path
    recordings: Path | None = None
    excerpts: Path | None = None
    networks: tuple[Path, ...] = ()
    joints: tuple[str, ...] = ()
    trace: Path | None = None
    pictures: bool = True
    reading: ReadingOptions = AS_THE_FILES_SAY


def run(options: ExperimentOptions) -> None:
    """Dance, measure, draw and write; what was found goes to standard output as a table."""
    console = Console(stderr=True)
    coders = _coders(options)
    first = next(iter(coders.values()))
    joints = _joints(options.joints, first)
    takes = _takes(options, first)
    excerpts = (
        choose(takes, first.joints)
        if options.excerpts is None
        else named(options.excerpts, takes, first.joints)
    )
    for one in excerpts:
        console.print(f"- {one.name}: {one.take} from {one.first / FPS:.1f} s; {one.why}.", highlight=False)
    skeleton = takes[0].recording.skeleton
    trace = (
        usual_trace(excerpts, skeleton.index(joints[0]))
        if options.trace is None
        else read_trace(options.trace)
    )
    options.out.mkdir(parents=True, exist_ok=True)
    found, pictures, work = {}, dict[str, list[Path]](), len(coders) * len(excerpts)
    figure_2 = options.out / "excerpts.png"
    drawing: list[Future[Path]] = []
    with (
        ProcessPoolExecutor(mp_context=get_context("spawn")) as pool,  # a strip takes seconds
        reported(
            console, work * len(CONDITIONS) + len(KINDS) + (1 + work * len(FIGURES)) * options.pictures
        ) as advance,
    ):
        if options.pictures:
            pictures["The five as recorded"] = [figure_2]
            drawing.append(pool.submit(draw_strips, *strip_of_excerpts(figure_2, excerpts)))
        for name, coder in coders.items():
            folder = options.out / _file_name(name)
            trials = [Trial(coder, one, joints, trace) for one in excerpts]
            for trial in trials:
                trial.run(advance)
                _write_dances(trial, folder / trial.excerpt.name)
                wanted = strips_of_trial(trial, folder / trial.excerpt.name, name) if options.pictures else []
                drawing += [pool.submit(draw_strips, *one) for one in wanted]
                pictures[f"{name}: {trial.excerpt.name}, {trial.excerpt.why}"] = [one[0] for one in wanted]
            found[name] = claims(trials)
        nulls = _null_claims(first, excerpts, joints, trace, advance)
        for done in as_completed(drawing):
            done.result()
            advance("drawing")
    if options.pictures:
        draw_claims(options.out / "experiments.png", TITLE, found, figure_2, nulls)
    write_report(options.out / "experiments.json", _report(coders, excerpts, joints, found, nulls))
    write_page(
        options.out / "experiments.html",
        TITLE,
        _paragraphs(joints, options),
        excerpts,
        found,
        nulls,
        pictures,
    )
    _print_verdicts(Console(), found, nulls)
    console.print(
        f"{options.out / 'experiments.html'} shows all of it; BVH and strips lie beside it.", highlight=False
    )


def read_trace(file: Path) -> Array:
    """A sensor's trace, (N, 4) at 50 Hz: CSV rows of seconds, w, x, y, z; local to the joint's parent.

    Raises StudioError with the line.
    """
    rows: list[list[float]] = []
    with opened_text(file) as lines:
        for number, row in enumerate(csv.reader(lines), 1):
            if not row or (number == 1 and not _is_number(row[0])):
                continue
            try:
                values = [float(cell) for cell in row]
            except ValueError:
                values = []
            if len(values) != 5 or not np.isfinite(values).all() or not any(values[1:]):
                raise StudioError(f"{file}, line {number}: a row has seconds and a quaternion: 0.02,1,0,0,0.")
            if rows and values[0] <= rows[-1][0]:
                raise StudioError(
                    f"{file}, line {number}: {values[0]} s comes after {rows[-1][0]} s. Sort by time."
                )
            rows.append(values)
    if len(rows) < 2:
        raise StudioError(f"{file} has no trace: rows of seconds, w, x, y, z are needed.")
    table = np.array(rows)
    turns = quaternion.continuous(quaternion.normalize(table[:, 1:]))
    times = np.arange(table[0, 0], table[-1, 0], 1 / FPS)
    later = np.clip(np.searchsorted(table[:, 0], times, side="right"), 1, len(table) - 1)
    spans = table[later, 0] - table[later - 1, 0]
    shares = (times - table[later - 1, 0]) / spans
    return quaternion.continuous(quaternion.slerp(turns[later - 1], turns[later], shares))


def _coders(options: ExperimentOptions) -> dict[str, Coder]:
    """The show's network first; the others move the same joints."""
    found: dict[str, Coder] = {}
    for path in (options.show, *options.networks):
        coder = open_coder(path)
        name = f"{coder.facts['architecture']}, {coder.facts['precision']}"
        name = f"{name}, {path.name}" if name in found else name
        alike = sum(other.partition(" (")[0] == name for other in found)
        found[f"{name} ({alike + 1})" if alike else name] = coder
    joints = next(iter(found.values())).joints
    for name, coder in found.items():
        if coder.joints != joints:
            raise StudioError(
                f"{name} moves other joints than {options.show}: networks of one dancer can be compared."
            )
    return found


def _joints(wanted: Sequence[str], coder: Coder) -> tuple[str, ...]:
    """As asked for, each once; else the left upper arm."""
    usual = held_joints(coder.joints).get("left upper arm")
    joints = tuple(dict.fromkeys(wanted)) or (() if usual is None else (usual,))
    messages = [f"'{joint}' is not moved by the network" for joint in joints if joint not in coder.joints]
    if messages or not joints:
        messages = messages or ["There is no left shoulder by a usual name"]
        raise StudioError(f"{messages[0]}. Say what to hold with --joint: {', '.join(coder.joints)}.")
    return joints


def _takes(options: ExperimentOptions, coder: Coder) -> list[Take]:
    """Where the excerpts come from: recordings, those kept apart from training, else the show's phrase."""
    if options.recordings is None:
        return load_takes([load_show(options.show).phrase], coder, options.reading)
    trained = remembered_reading(options.show)
    if options.excerpts is not None:
        return load_takes(recordings_in(options.recordings), coder, options.reading, trained)
    dataset = load_folder(options.recordings, options.reading.over(trained.options))
    return list(dataset.measured_on())


def _null_claims(
    coder: Coder,
    excerpts: Sequence[Excerpt],
    joints: Sequence[str],
    trace: Array,
    advance: Callable[[str], None],
) -> dict[str, list[Claim]]:
    """The claims on networks that know nothing, by name; coder: whose joints and mean pose."""
    found = {}
    for name, null in null_networks(coder.joints, coder.rest).items():
        advance(f"a network that knows nothing: {name}")
        found[name] = claims([Trial(null, one, joints, trace) for one in excerpts])
    return found


def _write_dances(trial: Trial, folder: Path) -> None:
    """BVH of the excerpt and of every dance on it."""
    folder.mkdir(parents=True, exist_ok=True)
    write_bvh(folder / "excerpt.bvh", trial.once.recording)
    for condition, dance in trial.dances.items():
        write_bvh(folder / f"{condition.name}.bvh", trial.whole(dance))


def _report(
    coders: Mapping[str, Coder],
    excerpts: Sequence[Excerpt],
    joints: Sequence[str],
    found: Mapping[str, Sequence[Claim]],
    nulls: Mapping[str, Sequence[Claim]],
) -> dict[str, object]:
    def by_letter(claims: Sequence[Claim]) -> dict[str, object]:
        return {one.letter: one.as_json() for one in claims}

    return {
        "joints": list(joints),
        "excerpts": {one.name: one.as_json() for one in excerpts},
        "networks": {
            name: {"facts": coders[name].facts, "claims": by_letter(found[name])} for name in coders
        },
        "null_networks": {name: {"claims": by_letter(claims)} for name, claims in nulls.items()},
        "worth": {one.letter: worth(one, nulls) for one in next(iter(found.values()))},
    }


def _paragraphs(joints: Sequence[str], options: ExperimentOptions) -> list[str]:
    trace = "recorded in the liveliest excerpt, both ways" if options.trace is None else options.trace.name
    return [
        "The experiments of 'Puppeteering an AI' (section 4). Five excerpts of 200 frames at 50 Hz are "
        f"danced with 1 to 10 coding iterations and no hand; then with {' and '.join(joints)} kept at the "
        f"recorded orientation pose by pose; then with {joints[0]} turned about an axis at one and at five "
        "seconds a turn, led by a sensor's trace, and held still. K/J are coding and interaction iterations.",
        "Windows of 8 poses, one a tick, blended by Hann weights as in the paper. The sensor's trace: "
        f"{trace}.",
        "Four null networks dance the same as each network: copy returns each window and ignores the hand, "
        "paste returns it with the held joint in it, mean pulls every joint to the dancer's mean pose, "
        "untrained has random weights. A claim that one of them passes says nothing of what a network "
        "has learned, except where the claim is that nothing changes: (a), (b). A margin is how many times "
        "over the weakest figure keeps its bound, in more than half of the excerpts: from 1 on it holds.",
    ]


def _print_verdicts(
    console: Console, found: Mapping[str, Sequence[Claim]], nulls: Mapping[str, Sequence[Claim]]
) -> None:
    table = Table(title="The paper's claims; in brackets how many times over the bounds are kept")
    for heading in ("claim", *found, "null networks"):
        table.add_column(heading)
    for rows in zip(*found.values(), strict=True):
        bounds = "; ".join(map(str, rows[0].bounds))
        table.add_row(
            f"({rows[0].letter}) {rows[0].text} ({bounds})",
            *map(verdict, rows),
            worth(rows[0], nulls),
        )
    console.print(table)


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in name).strip("_")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
