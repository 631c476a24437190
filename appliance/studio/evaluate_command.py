"""`bunraku evaluate`: a table for people, JSON for everything else."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from appliance.studio.coders import Coder, OnnxCoder, open_coder
from appliance.studio.dataset import WINDOW, Take, window_starts
from appliance.studio.evaluation import ITERATIONS, Evaluation, evaluate, load_takes

PATIENCE_S = 40.0
HOPS = (1, 2, 4, 8)


def run(
    network: Path, files: Sequence[Path], true_fps: float | None, as_json: bool, all_frames: bool
) -> None:
    """Measure and print. Figures go to standard output, everything else to standard error."""
    console = Console(stderr=True)
    coder = open_coder(network)
    takes = load_takes(files, coder, true_fps, all_frames)
    for take in takes:
        console.print(_about(take), highlight=False)

    def progress(parts: Iterable[Any], count: int) -> Iterable[Any]:
        return track(parts, "coding", count, console=console, transient=True, disable=not console.is_terminal)

    found = evaluate(coder, takes, fitting_hop(coder, takes), progress)
    if as_json:
        print(json.dumps({"network": coder.facts, **found.as_json()}, indent=1))
    else:
        _print_table(Console(), coder, found)


def fitting_hop(coder: Coder, takes: Sequence[Take], patience_s: float = PATIENCE_S) -> int:
    """Every window where that is quick; every 2nd, 4th or 8th where a network file is slow."""
    if not isinstance(coder, OnnxCoder):
        return 1
    starts = [(take, start) for take in takes for start in window_starts(take)[:1]]
    if not starts:
        return 1
    take, start = starts[0]
    places = [take.recording.skeleton.index(name) for name in coder.joints]
    window = take.recording.poses[start : start + WINDOW, places].astype("float32")
    coder.run(window, sum(ITERATIONS))
    began = time.perf_counter()
    for _ in range(3):
        coder.run(window, sum(ITERATIONS))
    cost_s = (time.perf_counter() - began) / 3 * sum(len(window_starts(take)) for take in takes)
    return next((hop for hop in HOPS if cost_s / hop <= patience_s), HOPS[-1])


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
