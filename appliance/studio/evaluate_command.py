"""`bunraku evaluate`: a table for people, JSON for everything else."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.roles import held_joints
from appliance.studio.data.dataset import Take, load_folder
from appliance.studio.data.remembered import remembered_reading
from appliance.studio.evaluation import puppetry, puppetry_report
from appliance.studio.evaluation.answer_picture import draw_answer
from appliance.studio.evaluation.coders import Coder, open_coder
from appliance.studio.evaluation.evaluation import Evaluation, evaluate, fitting_hop, load_takes
from appliance.studio.evaluation.measurement import Iterations, Measurement
from appliance.studio.evaluation.nearest import reference_of
from appliance.studio.evaluation.pairs import apart_from, pair_up
from appliance.studio.evaluation.recorded import Recorded
from appliance.studio.progress import reported, shown
from appliance.studio.studio_error import StudioError


@dataclass(frozen=True)
class EvaluateOptions:
    """The command line of bunraku evaluate."""

    network: Path
    recordings: Sequence[Path]
    reading: ReadingOptions = AS_THE_FILES_SAY
    as_json: bool = False
    hands: Sequence[Path] = ()
    reference: Path | None = None
    joints: Sequence[str] = ()
    iterations: Sequence[str] = ()
    picture: Path | None = None
    other_dancer: Path | None = None
    compared: bool = True


def run(options: EvaluateOptions) -> None:
    """Measure and print. Figures go to standard output, everything else to standard error."""
    console = Console(stderr=True)
    iterations = _checked(options)
    coder = open_coder(options.network)
    trained = remembered_reading(options.network)
    joints = _held_joints(coder, options.joints) if options.hands else []
    takes = load_takes(options.recordings, coder, options.reading, trained)
    hands = load_takes(options.hands, coder, options.reading, trained)
    for take in (*takes, *hands):
        console.print(_about(take), highlight=False)

    def progress(parts: Iterable[Any], count: int) -> Iterable[Any]:
        return shown(parts, "coding", console, count)

    answer = {}
    if options.reference is not None:
        reported = options.reading.over(trained.options)
        known = _known(options.reference, reported, (*takes, *hands))
        measurements = _measurements(console, coder, takes, hands, known)
        recorded = _recorded(options, coder, known) if options.compared else None
        answer = _answer(console, measurements, joints, iterations, recorded)
        if options.picture is not None:
            usual = puppetry.usual_iterations(iterations)
            draw_answer(options.picture, measurements[0], joints[0], usual)
            console.print(f"{options.picture} shows a hand on {joints[0]}.", highlight=False)
    found = evaluate(coder, takes, fitting_hop(coder, takes), progress)
    if options.as_json:
        figures = {"network": coder.facts, **found.as_json()}
        print(json.dumps({**figures, "puppetry": answer} if answer else figures, indent=1))
        return
    _print_table(Console(), coder, found)
    if answer:
        puppetry_report.print_answer(Console(), answer)


def _checked(options: EvaluateOptions) -> list[Iterations]:
    """The iterations asked for. Raises StudioError where options are missing or no numbers."""
    if bool(options.hands) != (options.reference is not None):
        raise StudioError(
            "--hands and --reference belong together: the answer to a hand is measured against what the "
            "dancer did in the recordings that the network learned from. Give both, or neither."
        )
    asked = options.joints or options.iterations or options.picture or options.other_dancer
    if not options.hands and (asked or not options.compared):
        raise StudioError(
            "--joint, --iterations, --picture, --other-dancer and --no-baselines are about a hand: give "
            "--hands as well."
        )
    if options.other_dancer is not None and not options.compared:
        raise StudioError("--other-dancer is a baseline, and --no-baselines wants none. Leave one out.")
    return [_iterations(text) for text in options.iterations] or list(puppetry.ITERATIONS)


def _measurements(
    console: Console,
    coder: Coder,
    takes: Sequence[Take],
    hands: Sequence[Take],
    known: Sequence[Take],
) -> list[Measurement]:
    """Every phrase with a hand of another take, and the training takes as reference."""
    pairs = pair_up(takes, hands)
    reference = reference_of(known, coder.joints)
    for pair in pairs:
        console.print(f"- {pair.phrase_name} with the hands of {pair.hand_name}.", highlight=False)
    return [Measurement(coder, pair, reference) for pair in pairs]


def _known(folder: Path, reading: ReadingOptions, given: Sequence[Take]) -> Sequence[Take]:
    """The training takes without those given. Raises StudioError if none is left."""
    known = apart_from(load_folder(folder, reading), given)
    if not known:
        raise StudioError(
            f"{folder} has no recording beside the phrases and the hands. "
            "Give the folder of the training takes."
        )
    return known


def _recorded(options: EvaluateOptions, coder: Coder, known: Sequence[Take]) -> Recorded:
    """The dances to which the held dance is compared."""
    other = () if options.other_dancer is None else load_folder(options.other_dancer, options.reading).takes
    return Recorded(known, coder.joints, other)


def _answer(
    console: Console,
    measurements: Sequence[Measurement],
    joints: Sequence[str],
    iterations: Sequence[Iterations],
    recorded: Recorded | None,
) -> dict[str, Any]:
    """The body's answer when a hand holds a joint, as JSON."""
    count = puppetry.dances(len(measurements), len(joints), iterations, compared=recorded is not None)
    with reported(console, count) as advance:
        return puppetry.measure(measurements, joints, iterations, advance=advance, recorded=recorded)


def _iterations(text: str) -> Iterations:
    coding, _, interaction = text.partition("/")
    if not (coding.isdigit() and interaction.isdigit() and int(coding) > 0):
        raise StudioError(f"'{text}' is no K/J: write for example 10/9, coding and interaction iterations.")
    return int(coding), int(interaction)


def _held_joints(coder: Coder, names: Sequence[str]) -> list[str]:
    """Those asked for, else the usual ones. Raises StudioError for what the network does not move."""
    for name in names:
        if name not in coder.joints:
            raise StudioError(f"No hand can hold '{name}': the network moves {', '.join(coder.joints)}.")
    found = list(names) or list(held_joints(coder.joints).values())
    if not found:
        raise StudioError(f"Say what to hold with --joint: the network moves {', '.join(coder.joints)}.")
    return found


def _about(take: Take) -> str:
    rate = f"{take.true_fps:g} poses a second"
    if abs(take.header_fps - take.true_fps) > 0.01:
        rate += f" (its header says {take.header_fps:g})"
    masked = int((~take.sound).sum())
    left_out = f", {masked} of {len(take.sound)} frames masked as capture errors" if masked else ""
    return f"- {take.name}: {take.recording.seconds:.1f} s, {rate}{left_out}."


def _print_table(console: Console, coder: Coder, found: Evaluation) -> None:
    figures = found.as_json()
    table = Table(
        title=f"{coder.facts['architecture']}, {coder.facts['precision']}, {figures['windows']} windows"
    )
    for heading in ("iterations", "degrees: mean", "95 % below", "largest", "centimetres: mean", "largest"):
        table.add_column(heading, justify="right")
    for k, degrees in figures["degrees"].items():
        row = [f"{degrees[key]:.2f}" for key in ("mean", "p95", "max")]
        moved = figures["centimetres"].get(k)
        row += [f"{moved[key]:.2f}" for key in ("mean", "max")] if moved else ["", ""]
        table.add_row(k, *row)
    console.print(table)
    latent = figures["latent"]
    console.print(
        f"Latents: mean {latent['mean']:.3f}, standard deviation {latent['std']:.3f} (the prior: 0 and 1).",
        highlight=False,
    )
