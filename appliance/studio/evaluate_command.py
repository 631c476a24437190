"""`bunraku evaluate`: a table for people, JSON for everything else."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from appliance.studio.data.dataset import Take
from appliance.studio.evaluation.coders import Coder, open_coder
from appliance.studio.evaluation.evaluation import Evaluation, evaluate, fitting_hop, load_takes


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
