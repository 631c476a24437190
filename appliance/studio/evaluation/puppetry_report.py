"""The measured answer of a dancer as a table and sentences."""

from __future__ import annotations

import statistics
from dataclasses import asdict
from typing import Any, Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from appliance.pose.roles import UPPER_ARMS, held_joints
from appliance.studio.evaluation.comparison_report import comparison_sentences, comparison_table
from appliance.studio.evaluation.dancer_verdict import (
    ANSWERS,
    ANSWERS_A_LITTLE,
    LIMBS,
    PLAUSIBLE,
    Learned,
    Seen,
    judge,
)

LIVELY = (0.7, 1.3)  # energy
COLUMNS = ["held", "K/J", "answer", "fit", "own/foreign"]
COLUMNS += ["plausibility", "energy", "roughness", "off hand"]


def judged(found: dict[str, Any], learned: Learned, error: float | None = None) -> dict[str, str]:
    """cause, verdict and advice of a measured dancer, by its upper arms where they were held.

    error: degrees off the recordings after one pass without a hand.
    """
    return asdict(judge(seen(found, error), learned))


def seen(found: dict[str, Any], error: float | None = None) -> Seen:
    """The result of puppetry.measure for the verdict: means over the joints held."""
    named = [name for part, name in held_joints(joints_of(found)).items() if part in UPPER_ARMS]
    rows = [strongest(found[joint])[1] for joint in named or joints_of(found)]
    free: dict[str, dict[str, float | None]] = found.get("free", {})
    in_play = free.get("10") or next(iter(free.values()), None) or {}
    return Seen(
        answer=statistics.fmean(row["answer"] for row in rows),
        error=error,
        energy={"whole": _mean(rows, "energy"), **{limb: _mean(rows, f"energy_{limb}") for limb in LIMBS}},
        spread={"whole": _mean(rows, "spread"), **{limb: _mean(rows, f"spread_{limb}") for limb in LIMBS}},
        free_energy=in_play.get("energy"),
        roughness=_mean(rows, "roughness"),
        plausibility=_mean(rows, "plausibility"),
        critic=_mean(rows, "critic"),
        fits=not any(row["fit"] is not None and row["fit"] > row["fit_bare"] for row in rows),
        off_hand=_mean(rows, "held"),
    )


def _mean(rows: list[dict[str, Any]], name: str) -> float | None:
    """Mean over the rows that have the figure."""
    values = [row[name] for row in rows if row.get(name) is not None]
    return statistics.fmean(values) if values else None


def print_answer(console: Console, found: dict[str, Any]) -> None:
    """Print table and sentences, or why nothing was measured."""
    if "not_measured" in found:
        message = f"Whether this dancer answers a hand could not be measured: {found['not_measured']}"
        console.print(message, highlight=False)
        return
    console.print(table(found))
    compared = comparison_table(found, joints_of(found))
    if compared is not None:
        console.print(compared)
    lines = [*sentences(found), *asides(found), *comparison_sentences(found)]
    if "verdict" in found:
        lines += [f"Measured {found['measured_on']}.", f"{found['verdict']} {found['advice']}".strip()]
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)


def table(found: dict[str, Any]) -> Table:
    """A row for each joint and K/J, hands that turn, and the dance without a hand."""
    made = Table(
        title="Does the hand move the body? Degrees; plausibility, energy, roughness: the phrase is 1",
        box=SIMPLE_HEAD,
        padding=0,  # figures and headings are whole in 80 columns, long names of joints are folded
        pad_edge=False,
    )
    for heading in COLUMNS:
        justify: Literal["left", "right"] = "left" if heading == "held" else "right"
        made.add_column(heading, justify=justify, min_width=len(heading), overflow="fold")
    for joint in joints_of(found):
        for key, row in iterations_of(found[joint]).items():
            made.add_row(joint, key.replace("_", "/"), *_row(row))
        if "turning" in found[joint]:
            made.add_row(joint, "turning", *_row(found[joint]["turning"]))
    for coding, row in found["free"].items():
        blank = {"answer": None, "fit": None, "fit_own": None, "fit_bare": None, "held": None}
        made.add_row("nothing", f"{coding}/0", *_row({**blank, **row}))
    return made


def sentences(found: dict[str, Any]) -> list[str]:
    """The meaning of the figures, one sentence for each joint.

    Noise moves the others as an answer does, and a lifeless pose fits everything a little: therefore fit,
    plausibility and energy count too.
    """
    return [_sentence(joint, *strongest(found[joint])) for joint in joints_of(found)]


def asides(found: dict[str, Any]) -> list[str]:
    """Onset of the answer, snaps, arms in the trunk, sliding feet."""
    joints, phrase = joints_of(found), found["phrase"]
    onsets = [found[joint]["onset_ticks"] for joint in joints]
    known = [ticks for ticks in onsets if ticks is not None]
    turned = [found[joint]["turning"]["largest_step"] for joint in joints if "turning" in found[joint]]
    lines = []
    if known:
        lines.append(f"Half of the answer to a step of the hand is out after {max(known):g} ticks.")
    if turned:
        lines.append(
            f"While hands turn smoothly, a joint goes up to {max(turned):.0f} degrees in one tick; in the "
            f"recordings {found['reference']['largest_step']:.0f}."
        )
    deep, depth, skate = (_mean_of(found, name) for name in ("arm_in_trunk", "arm_depth_cm", "foot_skate"))
    if deep is not None and phrase["arm_in_trunk"] is not None:
        lines.append(
            f"An upper arm is deep in the trunk in {100 * deep:.1f} % of the ticks (1 of 100 at least "
            f"{depth or 0:.1f} cm); in the phrase in {100 * phrase['arm_in_trunk']:.1f} % "
            f"({phrase['arm_depth_cm'] or 0:.1f} cm)."
        )
    strained, touch = (_mean_of(found, name) for name in ("strained", "arms_touch"))
    if strained is not None:
        lines.append(
            f"A joint that nobody holds is beyond what it ever did in {100 * strained:.1f} % of the ticks; "
            f"in the phrase in {100 * phrase['strained']:.1f} %. Arms touch in {100 * (touch or 0):.1f} %."
        )
    if skate is not None and phrase["foot_skate"] is not None:
        lines.append(f"Feet slide at {skate:.2f} m/s; in the phrase at {phrase['foot_skate']:.2f}.")
    return lines


def _mean_of(found: dict[str, Any], name: str) -> float | None:
    values = [strongest(found[joint])[1][name] for joint in joints_of(found)]
    return None if None in values else statistics.fmean(values)


def joints_of(found: dict[str, Any]) -> list[str]:
    """The joints that were held."""
    return [name for name, figures in found.items() if isinstance(figures, dict) and "onset_ticks" in figures]


def iterations_of(figures: dict[str, Any]) -> dict[str, Any]:
    """The rows of a joint by K_J."""
    return {key: row for key, row in figures.items() if key.replace("_", "").isdigit()}


def strongest(figures: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """K/J and row at 10/9 or, if that was not measured, at the most iterations."""
    rows = iterations_of(figures)
    key = "10_9" if "10_9" in rows else max(rows, key=lambda key: [int(part) for part in key.split("_")])
    return key.replace("_", "/"), rows[key]


def _sentence(joint: str, iterations: str, row: dict[str, Any]) -> str:
    meaning = {2: "this dancer answers", 1: "this dancer answers a little", 0: "this dancer hardly answers"}
    but = f", but {' and '.join(reservations(row))}" if reservations(row) else ""
    return (
        f"The others move {row['answer']:.1f} degrees with a hand on {joint} at {iterations}: "
        f"{meaning[degree(row)]}{but}."
    )


def degree(row: dict[str, Any]) -> int:
    """0: it hardly answers, 1: a little, 2: it answers."""
    return int(row["answer"] >= ANSWERS_A_LITTLE) + int(row["answer"] >= ANSWERS)


def reservations(row: dict[str, Any]) -> list[str]:
    """The fault of an answer: its poses are not the dancer's, or it has another energy.

    A network trained for one minute moved the others by 8.7 degrees at an energy of 1.05, with a fit below
    that of the bare phrase: only its plausibility (1.22) distinguished it from a dancer.
    """
    found = []
    plausibility = row["plausibility"]
    if degree(row) and row["fit"] is not None and row["fit"] > row["fit_bare"]:
        found.append("it does nothing that the dancer did with that joint")
    if degree(row) and plausibility is not None and plausibility > PLAUSIBLE:
        found.append(f"its poses are not the dancer's (plausibility {plausibility:.2f})")
    energy = row["energy"]
    if degree(row) and energy is not None and energy < LIVELY[0]:
        found.append(f"it comes nearly to rest (energy {energy:.2f})")
    if degree(row) and energy is not None and energy > LIVELY[1]:
        found.append(f"it is restless (energy {energy:.2f})")
    return found


def _row(row: dict[str, Any]) -> list[str]:
    baselines = "/".join(_number(row[key], 1) for key in ("fit_own", "fit_bare"))
    return [
        _number(row["answer"], 1),
        _number(row["fit"], 1),
        "" if row["fit_own"] is None else baselines,
        *(_number(row[key], 2) for key in ("plausibility", "energy", "roughness")),
        _number(row["held"], 1),
    ]


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
