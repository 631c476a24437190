"""The studio's commands, from a dancer's recordings to a show; those in separate modules join last.

Only this module loads with the command line; what needs torch is imported by the command that runs.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import is_written, refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.show.bundle import named_show
from appliance.studio import (
    compare_blind_command,
    compare_command,
    duet_command,
    exchange_command,
    experiment_command,
    granular_command,
    improvise_command,
    inspect_command,
    path_command,
    vary_command,
)
from appliance.studio.clear_errors import INTERRUPTED, clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


class NetworkName(StrEnum):
    """Architectures, by their names in architectures.NETWORKS; models.MODELS says which a model takes."""

    coupled = "coupled"
    mlp = "mlp"
    lstm = "lstm"
    lstm384 = "lstm384"
    dense64 = "dense64"
    moves = "moves"
    lstm_mixtures = "lstm-mixtures"


class ModelName(StrEnum):
    """The model to train, by its name in models.MODELS."""

    puppet = "puppet"
    pose = "pose"
    sequence = "sequence"
    improviser = "improviser"


class Device(StrEnum):
    """Where to compute."""

    auto = "auto"
    cpu = "cpu"
    cuda = "cuda"


Recordings = Annotated[Path | None, typer.Option(help="Folder with the dancer's BVH recordings.")]
Phrase = Annotated[
    Path | None,
    typer.Option(
        help="BVH that the show plays. Default: the one in --out, else the recorded stretch that loops best."
    ),
]
Name = Annotated[str | None, typer.Option(help="Name of the show. Default: the folder's name.")]
Hand = Annotated[str | None, typer.Option(help="Joint of the first hand. Default: left upper arm.")]


@app.command()
@reading_options
def train(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder for the show.")],
    recordings: Recordings = None,
    model: Annotated[
        ModelName,
        typer.Option(
            help="puppet: a show. pose: for path and map. sequence: for vary. improviser: for improvise."
        ),
    ] = ModelName.puppet,
    network: Annotated[
        NetworkName | None,
        typer.Option(
            help="Architecture. As published: lstm (puppet), dense64 (pose), lstm384 (sequence), "
            "lstm-mixtures (improviser).",
            show_default="coupled; mlp; of improvisers moves",
        ),
    ] = None,
    window: Annotated[
        int,
        typer.Option(
            min=0,
            max=128,
            help="Poses in a window, for granular; how many lstm-mixtures looks back, 10 to 128.",
            show_default="8, of sequences 128, lstm-mixtures 32",
        ),
    ] = 0,
    minutes: Annotated[
        float | None, typer.Option(min=0.01, help="Training time.", show_default="45, of poses 15")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Training steps, instead of --minutes.")] = None,
    seed: Annotated[int, typer.Option(help="The same seed and number of steps give the same network.")] = 1,
    latent: Annotated[int, typer.Option(min=0, help="Size of the latent. 0: as the network has it.")] = 0,
    width: Annotated[int, typer.Option(min=0, help="Width of the layers. 0: as the network has it.")] = 0,
    depth: Annotated[
        int, typer.Option(min=0, help="Blocks of coupled and mlp, layers of an lstm. 0: its own.")
    ] = 0,
    mixtures: Annotated[
        int, typer.Option(min=0, max=64, help="Gaussians of an improviser; published: 3 to 25. 0: its own.")
    ] = 0,
    ahead: Annotated[
        int, typer.Option(min=0, max=4, help="Poses that lstm-mixtures predicts at once, 1 to 4. 0: 1.")
    ] = 0,
    learning_rate: Annotated[
        float, typer.Option(min=0.0, max=0.1, help="Adam's, at its largest. 0: as the network has it.")
    ] = 0.0,
    batch: Annotated[
        int, typer.Option(min=0, max=65536, help="Windows in a training step. 0: as the network has it.")
    ] = 0,
    full_precision: Annotated[
        bool, typer.Option("--full-precision", help="On a GPU: networks in fp32 too, not in bfloat16.")
    ] = False,
    puppet: Annotated[
        Path | None,
        typer.Option(help="checkpoint.pt of the dancer that encodes for an improviser (moves)."),
    ] = None,
    start: Annotated[
        Path | None,
        typer.Option(
            "--from",
            callback=named_show,
            help="Show or checkpoint.pt whose network the training begins with.",
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the training in --out.")] = False,
    threads: Annotated[int, typer.Option(min=0, help="CPU cores to use. 0: all.")] = 0,
    device: Annotated[Device, typer.Option(help="auto: the GPU, if there is one.")] = Device.auto,
    catalogue: Annotated[
        Path | None, typer.Option(help="YAML: true rates, takes, held-out files; see docs/training.md.")
    ] = None,
    held_out: Annotated[
        list[str] | None, typer.Option(help="Files to measure on, not to train on ('solo_*'); repeatable.")
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(help="Files without capture errors, whatever they look like ('solo_*'); repeatable."),
    ] = None,
    phrase: Phrase = None,
    name: Name = None,
    hand: Hand = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Train a dancer on recordings and write a show that can be played to --out.

    Other models are those of 'Beyond Imitation': a checkpoint for the studio's other commands. Under torchrun
    the same command trains in several processes.
    """
    of_show, of_files = ("phrase", "name", "hand"), ("catalogue", "held_out", "keep")
    if model is not ModelName.puppet:
        refuse_idle(context, of_show, f"with --model {model.value}, which makes no show")
    if not resume and recordings is None and puppet is not None:
        refuse_idle(context, of_files, "without --recordings: the dancer's own are read as they were")
    if model is not ModelName.improviser and not resume:
        refuse_idle(context, ("puppet",), f"with --model {model.value}")
    with clear_errors("train"):
        from appliance.studio import train_command
        from appliance.studio.train_options import TrainOptions

        done = train_command.run(
            TrainOptions(
                out=out,
                recordings=recordings,
                model=model.value,
                network=network.value if network else None,
                window=window,
                minutes=minutes,
                steps=steps,
                seed=seed,
                latent=latent,
                width=width,
                depth=depth,
                mixtures=mixtures,
                ahead=ahead,
                learning_rate=learning_rate,
                batch=batch,
                full_precision=full_precision,
                puppet=puppet,
                start=start,
                resume=resume,
                threads=threads,
                device=device.value,
                catalogue=catalogue,
                held_out=tuple(held_out or ()),
                reading=reading,
                keep=tuple(keep or ()),
                phrase=phrase,
                name=name,
                hand=hand,
                written=tuple(name for name in ("model", "seed") if is_written(context, name)),
            )
        )
    if not done:
        raise typer.Exit(INTERRUPTED)


@app.command()
@reading_options
def evaluate(
    network: Annotated[
        Path, typer.Argument(callback=named_show, help="Show folder, puppet.onnx or checkpoint.pt.")
    ],
    recordings: Annotated[list[Path], typer.Argument(help="BVH recordings with the same joint names.")],
    json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
    hands: Annotated[
        list[Path] | None,
        typer.Option(help="BVH of another take, whose joints hold the puppet's one by one; repeatable."),
    ] = None,
    reference: Annotated[
        Path | None, typer.Option(help="Folder of the training takes: all that the dancer did.")
    ] = None,
    joint: Annotated[
        list[str] | None,
        typer.Option(help="Joint to hold; repeatable. Default: arms, head, chest and a thigh."),
    ] = None,
    iterations: Annotated[
        list[str] | None,
        typer.Option(help="K/J, coding and interaction iterations; repeatable. Default: 1/1 to 30/29."),
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="PNG: phrase, pasted arm, dancer's answer.")] = None,
    other_dancer: Annotated[
        Path | None, typer.Option(help="Folder of another dancer's recordings: the ceiling of FID.")
    ] = None,
    baselines: Annotated[
        bool, typer.Option(help="Critic, coupling, motion matching and more beside --hands.")
    ] = True,
    *,
    reading: ReadingOptions,
) -> None:
    """Measure how well a network reproduces a dance and, with --hands, whether its body answers a hand."""
    with clear_errors("evaluate"):
        from appliance.studio import evaluate_command

        evaluate_command.run(
            evaluate_command.EvaluateOptions(
                network=network,
                recordings=recordings,
                reading=reading,
                as_json=json,
                hands=tuple(hands or ()),
                reference=reference,
                joints=tuple(joint or ()),
                iterations=tuple(iterations or ()),
                picture=picture,
                other_dancer=other_dancer,
                compared=baselines,
            )
        )


@app.command()
@reading_options
def export(
    checkpoint: Annotated[Path, typer.Argument(help="checkpoint.pt of a training.")],
    out: Annotated[Path, typer.Option(help="Folder of the show; show.yaml and phrase.bvh in it are kept.")],
    recordings: Recordings = None,
    phrase: Phrase = None,
    name: Name = None,
    hand: Hand = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Make a show from a checkpoint: network, report, skeleton, phrase, checksums."""
    with clear_errors("export"):
        from appliance.studio import export_command

        export_command.run(checkpoint, out, recordings, phrase, name, hand, reading)


app.add_typer(exchange_command.app)
app.add_typer(inspect_command.app)
app.add_typer(experiment_command.app)
app.add_typer(granular_command.app)
app.add_typer(improvise_command.app)
app.add_typer(vary_command.app)
app.add_typer(path_command.app)
app.add_typer(duet_command.app)
app.add_typer(compare_command.app)
app.add_typer(compare_blind_command.app)
