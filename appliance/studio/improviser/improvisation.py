"""`bunraku improvise`: a phrase that an improviser danced, or what it danced after a prompt."""

from __future__ import annotations

import logging
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from appliance.dancer.material.steps import Steps
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.dance_files import write_dance
from appliance.studio.data.dataset import Dataset
from appliance.studio.disk_room import require_room
from appliance.studio.evaluation.coders import TorchCoder, load_puppet, load_state
from appliance.studio.improviser.continuing import continue_prompt
from appliance.studio.improviser.improvise_options import ImproviseOptions, PhraseOptions
from appliance.studio.improviser.improviser import Networks
from appliance.studio.improviser.improviser_training import (
    ImproviserSettings,
    ImproviserTraining,
    load_improviser,
)
from appliance.studio.improviser.learning import (
    fingerprint,
    moves_training,
    steps_of_dataset,
    train_until_done,
)
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.improviser.phrase import make_phrase, verdict
from appliance.studio.improviser.pose_mixtures_training import PoseMixturesSettings, load_pose_improviser
from appliance.studio.improviser.prompt import MovesFollower
from appliance.studio.improviser.steps import WindowCoder
from appliance.studio.model_uses import IMPROVISER
from appliance.studio.progress import logged
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import trained_on

_log = logging.getLogger(__name__)


def run(options: ImproviseOptions) -> bool:
    """Train if no model is given, improvise, write. False if stopped before the end; raises StudioError."""
    console = Console(stderr=True)
    with logged(console):
        return _run(options, console)


def _run(options: ImproviseOptions, console: Console) -> bool:
    if options.threads:
        torch.set_num_threads(options.threads)
    state = None if options.model is None else _improviser_state(options.model)
    if state is not None and state["settings"]["network"] == PoseMixturesSettings.network:
        assert options.model is not None
        _require_no_loop(options)
        published, _ = load_pose_improviser(options.model)
        dataset = trained_on(
            options.model, published.joints, state, options.recordings, console, options.reading
        )
        continue_prompt(options, published, published, dataset)
        return True
    coder, puppet_state, puppet = _puppet(options, state)
    require_room(options.out.parent)
    dataset = trained_on(puppet, coder.joints, puppet_state, options.recordings, console, options.reading)
    steps = steps_of_dataset(coder.autoencoder, dataset)
    if state is not None and options.model is not None:
        improviser, settings, learned = load_improviser(options.model)[0], state["settings"], state["step"]
    else:
        training = _training(options, coder.autoencoder, dataset, steps)
        file = improviser_file(options.out)
        if not train_until_done(training, file, file.with_suffix(".png"), console):
            _log.info("Stopped; nothing is lost. The same command continues.")
            return False
        improviser, settings, learned = training.averaged, asdict(training.settings), training.step
    if options.prompt is not None:
        continue_prompt(
            options, MovesFollower(WindowCoder(coder.autoencoder), Networks(improviser)), coder, dataset
        )
        return True
    phrase, natural = make_phrase(coder.autoencoder, improviser, dataset, steps, options.phrase)
    report: dict[str, Any] = {
        "phrase": asdict(options.phrase),
        "improviser": {"settings": settings, "steps": learned},
        "learned_from": [take.name for take in dataset.training if take.sound.any()],
        "naturalness": natural.as_json(),
    }
    title = f"{options.out.stem}: {phrase.seconds:.0f} s, seed {options.phrase.seed}"
    write_dance(options.out, phrase, title, report, rows=3)
    Console().print(naturalness_table({options.out.stem: natural}))
    _log.info(f"{options.out}: {verdict(natural)}")
    return True


def _require_no_loop(options: ImproviseOptions) -> None:
    """Raises StudioError for options about an endless phrase: the published improviser makes none."""
    loop, usual = options.phrase, PhraseOptions()
    if options.checkpoint is not None or (loop.dances, loop.minutes) != (usual.dances, usual.minutes):
        raise StudioError(
            f"{options.model} needs no dancer and makes no endless phrase: a CHECKPOINT, --dances and "
            "--dance-minutes do nothing. Leave them out."
        )


def improviser_file(out: Path) -> Path:
    """Where the improviser of a phrase is stored."""
    return out.with_suffix(".improviser.pt")


def _improviser_state(model: Path) -> dict[str, Any]:
    state = load_state(model)
    if state["settings"].get("model") != IMPROVISER:
        raise StudioError(
            f"{model} is no improviser. Train one with: bunraku train --model improviser, or give the "
            "checkpoint of a dancer without --model."
        )
    return state


def _puppet(
    options: ImproviseOptions, state: dict[str, Any] | None
) -> tuple[TorchCoder, dict[str, Any], Path]:
    """The dancer that encodes for our improviser: as given, or as the improviser's checkpoint remembers."""
    remembered = None if state is None else state["origin"].get("puppet")
    puppet = options.checkpoint or (None if remembered is None else Path(remembered))
    if puppet is None:
        raise StudioError("Give the dancer's checkpoint.pt, or an improviser with --model.")
    coder, puppet_state = load_puppet(puppet)
    if state is not None and fingerprint(coder.autoencoder) != state["origin"]["autoencoder"]:
        raise StudioError(
            f"{options.model} was trained with another dancer than {puppet}. Give that dancer's "
            "checkpoint.pt as the argument, or train again with --puppet."
        )
    return coder, puppet_state, puppet


def _training(
    options: ImproviseOptions, autoencoder: Autoencoder, dataset: Dataset, steps: list[Steps]
) -> ImproviserTraining:
    """The training stored beside the phrase, if it is for the same autoencoder; else a new one."""
    settings = ImproviserSettings(seed=options.phrase.seed, minutes=options.minutes, steps=options.steps)
    training = moves_training(autoencoder, dataset, steps, settings)
    file = improviser_file(options.out)
    if not file.exists():
        return training
    state = load_state(file)
    if state["origin"] != training.origin or state["shape"] != asdict(training.improviser.shape):
        _log.info(f"{file} belongs to another autoencoder and is replaced.")
        return training
    training.restore(state)
    # The phrase may have another seed than the improviser's training.
    training.settings = replace(settings, seed=state["settings"]["seed"])
    _log.info(f"{file} continues at {100 * training.fraction:.0f} %.")
    return training
