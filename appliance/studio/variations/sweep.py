"""The effect of noise of each strength on recorded dance: reported after training a sequence model.

'Beyond Imitation' reads it so: below 0.5 sigma subtle, 1 to 2 inventive with an element kept, 3 to 4 anything
from stillness to a body torn apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from appliance.pictures.filmstrip import Strip, draw_strips
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.losses import divergence
from appliance.studio.dance_files import write_report
from appliance.studio.data.dataset import FPS, Dataset, Take, window_starts
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.dance_figures import degrees_apart, energy
from appliance.studio.evaluation.nearest import Reference, reference_of, without_heading
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import standing
from appliance.studio.variations.timing import difference
from appliance.studio.variations.variations import encode_phrase, sampled, varied

SIGMAS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
WINDOWS, SEEDS = 16, 2
COLUMNS = 8  # pictures in a row
ACTIVE = 0.1  # standard deviation of a number's mean over the recordings: it says something about them


@dataclass(frozen=True)
class Row:
    """Means over windows and seeds. degrees from the recording; changed: degrees from what the model makes
    without noise, and the share of that which is timing; degrees from the nearest recorded pose; energy of
    the recording's.
    """

    degrees: float
    changed: float
    timing: float
    nearest: float
    energy: float


@dataclass(frozen=True)
class Sweep:
    """recorded_nearest: of the takes kept apart themselves; free: samples of the prior, with the energy of
    the recordings'; divergence: nats of a window from the prior; active: numbers of the latent that say
    something; spread: their standard deviation over the recordings.
    """

    rows: dict[float, Row]
    recorded_nearest: float
    free_nearest: float
    free_energy: float
    divergence: float
    active: int
    spread: float


def report(autoencoder: Autoencoder, dataset: Dataset, folder: Path, console: Console) -> None:
    """Measure, print, write report.json and variations.png."""
    takes = dataset.measured_on(autoencoder.shape.window)
    found = sweep(autoencoder, dataset, takes, console)
    write_report(folder / "report.json", {"variations": asdict(found)})
    with doing("drawing variations.png", console):
        _draw(folder / "variations.png", autoencoder, dataset, takes)
    Console().print(table(found))
    console.print(
        f"Takes kept apart: {found.recorded_nearest:.1f} degrees from the nearest recorded pose; samples of "
        f"the prior {found.free_nearest:.1f}, with {found.free_energy:.2f} of the recordings' energy. "
        f"{found.active} of {autoencoder.shape.latent} numbers of the latent are in use.",
        highlight=False,
    )


def sweep(
    autoencoder: Autoencoder, dataset: Dataset, takes: Sequence[Take], console: Console | None = None
) -> Sweep:
    """WINDOWS of the takes, varied by each of SIGMAS."""
    windows = _windows(takes, dataset, autoencoder.shape.window)
    reference = reference_of(dataset.training, dataset.moving_names)
    rows: dict[float, list[Row]] = {sigma: [] for sigma in SIGMAS}
    for number, window in enumerate(shown(windows, "varying takes kept apart", console)):
        phrase, pace = encode_phrase(autoencoder, window), energy(without_heading(window))
        own = varied(autoencoder, phrase, 0.0, 0)
        for sigma in SIGMAS:
            for seed in range(SEEDS if sigma else 1):
                made = varied(autoencoder, phrase, sigma, SEEDS * number + seed)
                change = difference(own, made)
                rows[sigma].append(
                    Row(
                        float(degrees_apart(without_heading(window), without_heading(made)).mean()),
                        change.degrees,
                        change.timing,
                        float(reference.nearest(made).mean()),
                        energy(without_heading(made)) / max(pace, 1e-9),
                    )
                )
    free = [sampled(autoencoder, 1.0, seed) for seed in range(WINDOWS)]
    usual = mean(energy(without_heading(window)) for window in windows)
    means, nats = _coded(autoencoder, windows)
    active = means.std(axis=0) > ACTIVE
    return Sweep(
        {sigma: _mean(each) for sigma, each in rows.items()},
        recorded_nearest=_nearest(reference, windows),
        free_nearest=_nearest(reference, free),
        free_energy=mean(energy(one) for one in free) / max(usual, 1e-9),
        divergence=nats,
        active=int(active.sum()),
        spread=float(means[:, active].std(axis=0).mean()) if active.any() else 0.0,
    )


def table(found: Sweep) -> Table:
    """For people."""
    shown = Table(title="Variations of takes kept apart, by the strength of the noise")
    changes = ("degrees from the recording", "changed by the noise", "of that timing")
    for name in ("sigma", *changes, "nearest recorded pose", "energy"):
        shown.add_column(name, justify="right")
    for sigma, row in found.rows.items():
        change = (f"{row.degrees:.1f}", f"{row.changed:.1f}", f"{row.timing:.0%}")
        shown.add_row(f"{sigma:g}", *change, f"{row.nearest:.1f}", f"{row.energy:.2f}")
    return shown


def _windows(takes: Sequence[Take], dataset: Dataset, length: int) -> list[Poses]:
    """Evenly over all sound windows of the takes, or fewer where there are fewer."""
    places = [(take, start) for take in takes for start in window_starts(take, window=length)]
    chosen = np.unique(np.linspace(0, len(places) - 1, min(WINDOWS, len(places))).round().astype(int))
    moving = list(dataset.moving)
    return [
        places[at][0].recording.poses[places[at][1] : places[at][1] + length, moving].astype(np.float32)
        for at in chosen
    ]


@torch.no_grad()
def _coded(autoencoder: Autoencoder, windows: Sequence[Poses]) -> tuple[Poses, float]:
    """Means (W, Z) of the windows' latents, and how many nats the windows are from the prior."""
    given = torch.from_numpy(np.stack(windows))
    level = autoencoder.without_heading(given, autoencoder.facing(given))
    means, log_variances = autoencoder.encode_gaussian(level)
    return means.numpy(), float(divergence(means, log_variances))


def _draw(path: Path, autoencoder: Autoencoder, dataset: Dataset, takes: Sequence[Take]) -> None:
    """The liveliest of the windows, and its variations under it."""
    windows = _windows(takes, dataset, autoencoder.shape.window)
    window = max(windows, key=lambda one: energy(without_heading(one)))
    recorded = standing(window, None, dataset)
    strips = [Strip(recorded.poses, recorded.roots, "recorded")]
    phrase = encode_phrase(autoencoder, window)
    for sigma in SIGMAS:
        made = standing(varied(autoencoder, phrase, sigma, 1), None, dataset)
        strips.append(Strip(made.poses, made.roots, f"{sigma:g} sigma", behind=strips[0]))
    title = "One phrase, moved by noise in the latents"
    draw_strips(path, dataset.skeleton, strips, FPS, title, columns=COLUMNS)


def _nearest(reference: Reference, dances: Sequence[Poses]) -> float:
    return mean(float(reference.nearest(one).mean()) for one in dances)


def _mean(rows: Sequence[Row]) -> Row:
    columns = zip(*(asdict(row).values() for row in rows), strict=True)
    return Row(*(float(np.mean(column)) for column in columns))
