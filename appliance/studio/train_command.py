"""`bunraku train`: from recordings to a trained network, and from it to a show."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from torch import nn

from appliance.dancer.material.improvising import MOVE
from appliance.pose.counted import counted
from appliance.studio.autoencoder.models import AnySettings, settings_for, settings_from
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.autoencoder.training_run import LOSSES_PICTURE, TrainingRun, parameters
from appliance.studio.data import sources
from appliance.studio.data.dataset import WINDOW
from appliance.studio.data.sources import Sources
from appliance.studio.disk_room import require_room
from appliance.studio.evaluation.coders import load_checkpoint, load_puppet, load_state
from appliance.studio.evaluation.findings import MASKED_PICTURE, few_data, findings, require_windows
from appliance.studio.evaluation.masked import draw_masked
from appliance.studio.export.improviser_network import export_improviser
from appliance.studio.export.motion_network import FILES, export_motion
from appliance.studio.export.release import Request, release
from appliance.studio.going_on import doubt, open_start, require_same_joints, settings_of, takes_known_to
from appliance.studio.improviser import own_output
from appliance.studio.improviser.improviser_training import ImproviserTraining
from appliance.studio.improviser.learning import AnyTraining, train_until_done, training_for
from appliance.studio.improviser.pose_mixtures_training import PoseMixturesTraining
from appliance.studio.model_uses import USES
from appliance.studio.opened_model import say_if_dead
from appliance.studio.pose_space.ground import Ground
from appliance.studio.processes import Processes, joined
from appliance.studio.studio_error import StudioError
from appliance.studio.train_options import TrainOptions
from appliance.studio.trained_on import reading_progress
from appliance.studio.variations.sweep import report

_SIZES = ("window", "latent", "width", "depth", "mixtures", "ahead", "learning_rate", "batch")


def run(options: TrainOptions) -> bool:
    """Train, then write the show. False if it was stopped before its end.

    Started by torchrun, all processes train, and the first one writes and prints. Raises StudioError,
    DatasetError or BvhError.
    """
    device = choose_device(options.device)
    if options.threads:
        torch.set_num_threads(options.threads)
    with joined(device) as processes:
        return _train(options, device, processes)


def _train(options: TrainOptions, device: str, processes: Processes) -> bool:
    console = Console(stderr=True, quiet=not processes.leads)
    checkpoint = options.out / "checkpoint.pt"
    settings, source, state = _settings_and_source(options, checkpoint)
    start = known = None
    if options.start is not None:
        start, known = open_start(options.start), takes_known_to(options.start)
        settings = settings_of(start, settings, options)
        source = source.for_network(known or ())
    if processes.leads:
        require_room(options.out)
    dataset = source.load(reading_progress(console))
    for line in findings(dataset):
        console.print(f"- {line}", highlight=False)
    if options.start is not None and (doubtful := doubt(options.start, known, dataset)):
        console.print(doubtful, highlight=False, soft_wrap=True)
    if processes.leads and any(take.errors for take in dataset.takes):
        draw_masked(options.out / MASKED_PICTURE, dataset.takes)
    training: Training | AnyTraining
    if isinstance(settings, Settings):
        require_windows(dataset, settings.batch, settings.window)
        if start is not None and options.start is not None:
            require_same_joints(start, dataset, options.start)
        begin = None if start is None else start.autoencoder
        training = Training(dataset, settings, device, processes, begin)
    else:
        training = training_for(settings, dataset, _puppet(options, state), device, processes)
    training.origin |= source.learned_by(dataset, known or ()).as_state()
    begun_with = (
        options.start.resolve().name if options.start else (state or {}).get("origin", {}).get("from")
    )
    if begun_with:
        training.origin["from"] = begun_with
    if state is not None:
        with _of_this_version(checkpoint):
            training.restore(state)
    options.out.mkdir(parents=True, exist_ok=True)
    console.print(_plan(training, device), highlight=False)
    done = (
        TrainingRun(training, options.out, console).run()
        if isinstance(training, Training)
        else train_until_done(training, checkpoint, options.out / LOSSES_PICTURE, console)
    )
    if done and processes.leads:
        _finish(training, options, source, console)
    if not done:
        again = f"bunraku train --resume --out {shlex.quote(str(options.out))}"
        console.print(
            f"Stopped at {100 * training.fraction:.0f} %; nothing is lost. Continue with: {again}",
            highlight=False,
            soft_wrap=True,
        )
    return done


def _finish(
    training: Training | AnyTraining, options: TrainOptions, source: Sources, console: Console
) -> None:
    """The report of a model, or the show of a puppet."""
    settings, checkpoint = training.settings, options.out / "checkpoint.pt"
    if isinstance(training, PoseMixturesTraining):
        own_output.report(training, checkpoint, console)
    if not isinstance(training, Training) or training.settings.model != "puppet":
        if isinstance(training, Training) and settings.model == "sequence":
            report(load_checkpoint(checkpoint)[0].autoencoder, training.dataset, options.out, console)
        if isinstance(training, Training) and settings.model in FILES:
            _finish_motion(training, checkpoint, console)
        if isinstance(training, ImproviserTraining):
            _export_improviser(training, checkpoint, console)
        console.print(f"{checkpoint} is ready. Its use: {USES[settings.model]}.")
    elif training.settings.window != WINDOW:
        console.print(
            f"{checkpoint} dances by itself: bunraku granular {shlex.quote(str(checkpoint))} --out "
            f"phrase.bvh. It is no show: the box dances windows of {WINDOW} poses."
        )
    else:
        request = Request(checkpoint, source, options.out, options.name or "", options.phrase, options.hand)
        found = release(request, training.dataset, console)
        show = shlex.quote(str(options.out))
        if "not_measured" in found["puppetry"]:  # else the advice says what more recordings would do
            for line in few_data(training.dataset):
                console.print(line, highlight=False)
        console.print(f"{options.out} is a show. Dance it: bunraku play --show {show} --emulate")


def _finish_motion(training: Training, checkpoint: Path, console: Console) -> None:
    """The file of a pose or sequence model for a show, and whether the model is alive."""
    coder, settings = load_checkpoint(checkpoint)[0], training.settings
    if settings.network == "mlp":
        file = export_motion(coder, training.dataset, settings.model, checkpoint.parent)
        console.print(f"{file}: a show that holds it dances from it live (docs/variations.md, On stage).")
    if not say_if_dead(coder.autoencoder, training.dataset, console) and settings.model == "pose":
        ground = Ground.of(coder.autoencoder, training.dataset)
        console.print(ground.reach.sentence(), highlight=False, soft_wrap=True)


def _export_improviser(training: ImproviserTraining, checkpoint: Path, console: Console) -> None:
    """improviser.onnx beside the checkpoint, if the dancer is of a kind that the box's sources take."""
    coder = load_puppet(Path(training.origin["puppet"]))[0]
    try:
        file = export_improviser(training.averaged, coder.autoencoder, coder.joints, checkpoint.parent)
        console.print(f"{file}: a show that holds it improvises live (docs/variations.md, On stage).")
    except StudioError as error:
        console.print(f"No improviser.onnx for a show: {error}")


def choose_device(wanted: str) -> str:
    """cuda or cpu. Raises StudioError if cuda is wanted and there is no GPU."""
    available = torch.cuda.is_available()
    if wanted == "cuda" and not available:
        raise StudioError("PyTorch finds no CUDA GPU. Omit --device to train on the CPU.")
    return "cuda" if available and wanted != "cpu" else "cpu"


def _settings_and_source(
    options: TrainOptions, checkpoint: Path
) -> tuple[AnySettings, Sources, dict[str, Any] | None]:
    """Settings, recordings and, with --resume, the checkpoint's state. Raises StudioError."""
    if options.resume:
        if not checkpoint.exists():
            raise StudioError(f"{options.out} has no checkpoint.pt to resume. Omit --resume.")
        state = load_state(checkpoint)
        with _of_this_version(checkpoint):
            settings = settings_from(state["settings"])
            source = sources.remembered(state, options.recordings, checkpoint, options.reading)
        _require_as_begun(options, settings, source)
        return _paced(settings, options), source, state
    if checkpoint.exists():
        raise StudioError(
            f"{options.out} already has a training. Continue it with --resume, or give another --out."
        )
    if options.recordings is None and options.puppet is None:
        raise StudioError("Give the folder of the recordings: --recordings FOLDER.")
    settings = settings_for(
        options.model,
        options.network,
        window=options.window,
        latent=options.latent,
        width=options.width,
        depth=options.depth,
        mixtures=options.mixtures,
        ahead=options.ahead,
        learning_rate=options.learning_rate,
        batch=options.batch,
        seed=options.seed,
    )
    if options.recordings is None:
        assert options.puppet is not None
        source = sources.remembered(load_state(options.puppet), None, options.puppet, options.reading)
        return _paced(settings, options), source, None
    source = sources.given(
        options.recordings, options.catalogue, options.held_out, options.reading, options.keep
    )
    return _paced(settings, options), source, None


@contextmanager
def _of_this_version(checkpoint: Path) -> Iterator[None]:
    """Raises StudioError where a checkpoint lacks what this version needs, or has what it does not know."""
    try:
        yield
    except (KeyError, TypeError, RuntimeError) as error:
        raise StudioError(
            f"{checkpoint} is of another version of Bunraku, and --resume cannot continue it ({error}). "
            "Continue it with that version, or begin in another --out."
        ) from error


def _require_as_begun(options: TrainOptions, settings: AnySettings, source: Sources) -> None:
    """Raises StudioError for options that a training which goes on can no longer follow."""
    other = [
        f"--{name.replace('_', '-')} (it has {getattr(settings, name, 'none')})"
        for name in (*options.written, "network", *_SIZES)
        if getattr(options, name) and getattr(options, name) != getattr(settings, name, None)
    ]
    if options.catalogue or options.held_out or options.keep:
        asked = sources.given(
            source.recordings, options.catalogue, options.held_out, options.reading, options.keep
        )
        if asked.catalogue != replace(source.catalogue, learned=()):
            other.append("--catalogue, --held-out or --keep (its recordings stay as they were)")
    if other:
        raise StudioError(
            f"--resume continues the training in {options.out} as it began, so it cannot follow "
            f"{', '.join(other)}. Leave them out, or give another --out."
        )


def _puppet(options: TrainOptions, state: dict[str, Any] | None) -> Path | None:
    """The dancer that encodes for our improviser: given, or remembered by its checkpoint."""
    remembered = None if state is None else state["origin"].get("puppet")
    return options.puppet or (None if remembered is None else Path(remembered))


def _paced(settings: AnySettings, options: TrainOptions) -> AnySettings:
    """Settings with the minutes or steps and the precision of the command line, if given.

    Raises StudioError for both minutes and steps.
    """
    if options.full_precision:
        settings = replace(settings, mixed=False)
    if options.minutes is not None and options.steps is not None:
        raise StudioError("Give --minutes or --steps, not both: each sets the learning rate's pace.")
    if options.steps is not None:
        return replace(settings, steps=options.steps)
    if options.minutes is not None:
        return replace(settings, minutes=options.minutes, steps=0)
    return settings


def _plan(training: Training | AnyTraining, device: str) -> str:
    settings, processes = training.settings, training.processes
    bound = counted(settings.steps, "step") if settings.steps else f"{settings.minutes:g} minutes"
    done = f", {100 * training.fraction:.0f} % done" if training.step else ""
    where = "the GPU" if device == "cuda" else f"the CPU ({counted(torch.get_num_threads(), 'thread')})"
    shared = f" in each of {processes.count} processes" if processes.count > 1 else ""
    network, message = _described(training)
    return (
        f"{settings.network}, {message}: {parameters(network) / 1e6:.2f} million parameters; {bound} on "
        f"{where}{shared}{done}."
    )


def _described(training: Training | AnyTraining) -> tuple[nn.Module, str]:
    """A training's network, and its sizes in words."""
    if isinstance(training, Training):
        sizes = training.autoencoder.shape
        message = f"windows of {sizes.window} poses, latent {sizes.latent}, width {sizes.width}"
        return training.autoencoder.network, message
    if isinstance(training, PoseMixturesTraining):
        shape = training.network.shape
        return training.network, (
            f"{shape.depth} x {shape.width}, looks back {shape.back} poses, predicts {shape.ahead}, "
            f"{shape.mixtures} Gaussians over {shape.kept} components"
        )
    return training.improviser, f"moves of {MOVE} steps, {training.settings.mixtures} Gaussians"
