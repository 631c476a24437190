"""`bunraku improvise`: trains an improviser on recordings and writes a phrase that it danced."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from appliance.pose.recording import Recording
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.training_run import stop_signals
from appliance.studio.dance_files import write_dance
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import TorchCoder, load_puppet
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.improviser_training import (
    ImproviserReport,
    ImproviserSettings,
    ImproviserTraining,
)
from appliance.studio.improviser.moves import BEFORE, MOVE
from appliance.studio.improviser.naturalness import Naturalness, Yardstick, measure
from appliance.studio.improviser.phrase import PhraseOptions, make_phrase, verdict
from appliance.studio.improviser.prompt import continued
from appliance.studio.improviser.steps import ROOT, Steps, steps_of_takes
from appliance.studio.standing_dance import excerpt_of
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import trained_on


@dataclass(frozen=True)
class ImproviseOptions:
    """The command line of bunraku improvise."""

    checkpoint: Path
    out: Path
    recordings: Path | None = None
    minutes: float = 12.0
    steps: int = 0
    threads: int = 0
    phrase: PhraseOptions = field(default_factory=PhraseOptions)
    prompt: Path | None = None
    prompt_end: float | None = None  # seconds of the prompt; None: all of it


def run(options: ImproviseOptions) -> bool:
    """Train, improvise, write the phrase. False if stopped before the end; raises StudioError."""
    console = Console(stderr=True)
    if options.threads:
        torch.set_num_threads(options.threads)
    coder, state = load_puppet(options.checkpoint)
    autoencoder = coder.autoencoder
    dataset = trained_on(options.checkpoint, coder.joints, state, options.recordings, console)
    steps = steps_of_takes(autoencoder, dataset.training, dataset.moving, BEFORE + MOVE)
    held_out = steps_of_takes(autoencoder, dataset.held_out, dataset.moving, BEFORE + MOVE)
    training = _training(options, autoencoder, steps, held_out, console)
    if not _train(training, improviser_file(options.out), console):
        return False

    def say(message: str) -> None:
        console.print(message, highlight=False, soft_wrap=True)

    if options.prompt is not None:
        continue_prompt(options, coder, training.averaged, dataset, say)
        return True
    phrase, natural = make_phrase(autoencoder, training.averaged, dataset, steps, options.phrase, say)
    write_phrase(options, phrase, natural, dataset, training)
    say(f"{options.out}: {verdict(natural)}")
    return True


def continue_prompt(
    options: ImproviseOptions,
    coder: TorchCoder,
    improviser: Improviser,
    dataset: Dataset,
    say: Callable[[str], None],
) -> None:
    """The prompt and what the improviser dances after it, with a report and a picture."""
    assert options.prompt is not None
    end = 1e9 if options.prompt_end is None else options.prompt_end
    prompt = excerpt_of(options.prompt, 0.0, end, coder, dataset.skeleton)
    asked = options.phrase
    made = continued(
        coder.autoencoder, improviser, dataset, prompt, asked.seconds, asked.temperature, asked.seed
    )
    words = f"the prompt ends at {made.joined_s:.1f} s"
    figures = {"joined_s": made.joined_s, "seam_degrees": made.seam, "usual_degrees": made.usual}
    natural = measure(made.dance, Yardstick.of(dataset.training, dataset.moving), endless=False)
    report = {"phrase": asdict(asked), **figures, "naturalness": natural.as_json()}
    write_dance(options.out, made.dance, f"{options.out.stem}: {words}", report, rows=3)
    say(
        f"{options.out}: {made.dance.seconds:.1f} s; {words}. The largest step of a joint around there is "
        f"{made.seam:.1f} degrees, {made.usual:.1f} are usual in the prompt. {verdict(natural)}"
    )


def improviser_file(out: Path) -> Path:
    """Where the improviser of a phrase is stored."""
    return out.with_suffix(".improviser.pt")


def write_phrase(
    options: ImproviseOptions,
    phrase: Recording,
    natural: Naturalness,
    dataset: Dataset,
    training: ImproviserTraining,
) -> None:
    """The phrase, its report (JSON) and a picture of it."""
    report: dict[str, Any] = {
        "phrase": asdict(options.phrase),
        "improviser": {"settings": asdict(training.settings), "steps": training.step},
        "learned_from": [take.name for take in dataset.training if take.sound.any()],
        "naturalness": natural.as_json(),
    }
    title = f"{options.out.stem}: {phrase.seconds:.0f} s, seed {options.phrase.seed}"
    write_dance(options.out, phrase, title, report, rows=3)


def _training(
    options: ImproviseOptions,
    autoencoder: Autoencoder,
    steps: list[Steps],
    held_out: list[Steps],
    console: Console,
) -> ImproviserTraining:
    """The training stored beside the phrase, if it is for the same autoencoder; else a new one."""
    settings = ImproviserSettings(seed=options.phrase.seed, minutes=options.minutes, steps=options.steps)
    rows = BEFORE + MOVE * settings.moves
    if not any(len(stretch) >= rows for stretch in steps):
        raise StudioError(
            f"No recording has {rows / 12.5:.0f} s without a capture error: too little to improvise from."
        )
    training = ImproviserTraining(
        [torch.tensor(stretch.features) for stretch in steps],
        [torch.tensor(stretch.features) for stretch in held_out],
        ROOT,
        settings,
    )
    training.origin = {"autoencoder": fingerprint(autoencoder)}
    file = improviser_file(options.out)
    if file.exists():
        state = torch.load(file, map_location="cpu", weights_only=True)
        if state["origin"] == training.origin and state["shape"] == asdict(training.improviser.shape):
            training.restore(state)
            # The phrase may have another seed than the improviser's training.
            training.settings = replace(settings, seed=state["settings"]["seed"])
            console.print(f"{file} continues at {100 * training.fraction:.0f} %.", highlight=False)
            return training
        console.print(f"{file} belongs to another autoencoder and is replaced.", highlight=False)
    return training


def fingerprint(autoencoder: Autoencoder) -> str:
    """A hash of an autoencoder's weights."""
    digest = hashlib.sha256()
    for value in autoencoder.state_dict().values():
        digest.update(value.numpy().tobytes())
    return digest.hexdigest()[:16]


def _train(training: ImproviserTraining, file: Path, console: Console) -> bool:
    """Train until done or stopped (Ctrl-C, SIGTERM); the improviser's file is written either way."""
    if training.fraction >= 1.0:
        return True
    file.parent.mkdir(parents=True, exist_ok=True)

    with stop_signals() as stop_asked, _progress(console) as progress:
        bar = progress.add_task("improviser", total=1.0, words="")

        def stop() -> bool:
            progress.update(bar, completed=training.fraction)
            return stop_asked()

        def report(line: ImproviserReport) -> None:
            words = _history_line(line)
            progress.update(bar, completed=line.fraction, words=words)
            if not console.is_terminal:
                console.print(f"{100 * line.fraction:5.1f} %  {words}", highlight=False, soft_wrap=True)

        training.run(report, lambda: training.save_checkpoint(file), save_every_s=60.0, stop=stop)
    if training.fraction < 1.0:
        console.print("Stopped; nothing is lost. The same command continues.")
    return training.fraction >= 1.0


def _progress(console: Console) -> Progress:
    columns = [TextColumn("learning to improvise"), BarColumn(), TaskProgressColumn()]
    words = TextColumn("{task.fields[words]}")
    return Progress(*columns, words, console=console, disable=not console.is_terminal)


def _history_line(line: ImproviserReport) -> str:
    parts = ", ".join(f"{name} {value:.3g}" for name, value in line.parts.items())
    held = ", ".join(f"{name} {value:.3g}" for name, value in line.held_out.items())
    return f"step {line.step}  {parts}" + (f"; held-out takes: {held}" if held else "")
