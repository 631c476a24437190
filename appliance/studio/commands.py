"""`bunraku train`, `evaluate`, `export` and `improvise`: from a dancer's recordings to a show."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from appliance.studio import experiment_command, granular_command, improvise_command
from appliance.studio.clear_errors import INTERRUPTED, clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


class NetworkName(StrEnum):
    """Architectures, as networks.NETWORKS has them."""

    conditional = "conditional"
    mlp = "mlp"
    conv = "conv"
    lstm = "lstm"
    lstm_autoregressive = "lstm-autoregressive"
    lstm256 = "lstm256"


class Device(StrEnum):
    """Where to compute."""

    auto = "auto"
    cpu = "cpu"
    cuda = "cuda"


Recordings = Annotated[Path | None, typer.Option(help="Folder with the dancer's BVH recordings.")]
Phrase = Annotated[
    Path | None,
    typer.Option(help="BVH that the show plays; left out: the folder's own, else an excerpt of a recording."),
]


@app.command()
def train(
    out: Annotated[Path, typer.Option(help="Folder of the show that comes out of it.")],
    recordings: Recordings = None,
    network: Annotated[NetworkName, typer.Option(help="Architecture.")] = NetworkName.conditional,
    minutes: Annotated[
        float | None, typer.Option(min=0.01, help="How long to train.", show_default="45")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="How many steps, instead of minutes.")] = None,
    seed: Annotated[int, typer.Option(help="The same seed and steps give the same network.")] = 1,
    latent: Annotated[int, typer.Option(min=0, help="Size of the latent; 0: the architecture's.")] = 0,
    width: Annotated[int, typer.Option(min=0, help="Width of the layers; 0: the architecture's.")] = 0,
    depth: Annotated[int, typer.Option(min=0, help="Blocks of an mlp; 0: its own.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the training in --out.")] = False,
    threads: Annotated[int, typer.Option(min=0, help="Processor cores to use; 0: all.")] = 0,
    device: Annotated[Device, typer.Option(help="auto: the GPU if there is one.")] = Device.auto,
    catalogue: Annotated[
        Path | None, typer.Option(help="YAML: true rates, takes, what is held out; see docs/training.md.")
    ] = None,
    held_out: Annotated[
        list[str] | None, typer.Option(help="Files to measure on, not to learn from ('solo_*'); repeatable.")
    ] = None,
    true_fps: Annotated[
        list[str] | None, typer.Option(help="PATTERN=FPS where a header is wrong ('salsa_*=60'); repeatable.")
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(help="Files in which nothing is a capture error ('solo_*'); repeatable."),
    ] = None,
    phrase: Phrase = None,
    name: Annotated[
        str | None, typer.Option(help="What the show is called; left out: as its folder.")
    ] = None,
) -> None:
    """Train a dancer on recordings; at the end --out is a show that can be played."""
    with clear_errors("train"):
        from appliance.studio import train_command

        done = train_command.run(
            train_command.Wish(
                out=out,
                recordings=recordings,
                network=network.value,
                minutes=minutes,
                steps=steps,
                seed=seed,
                latent=latent,
                width=width,
                depth=depth,
                resume=resume,
                threads=threads,
                device=device.value,
                catalogue=catalogue,
                held_out=tuple(held_out or ()),
                true_fps=tuple(true_fps or ()),
                keep=tuple(keep or ()),
                phrase=phrase,
                name=name,
            )
        )
    if not done:
        raise typer.Exit(INTERRUPTED)


@app.command()
def evaluate(
    network: Annotated[Path, typer.Argument(help="Show folder, puppet.onnx or checkpoint.pt.")],
    recordings: Annotated[list[Path], typer.Argument(help="BVH recordings with the same joint names.")],
    true_fps: Annotated[
        float | None, typer.Option(min=1, help="Rate of the recordings where their headers are wrong.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Figures as JSON on standard output.")] = False,
    all_frames: Annotated[bool, typer.Option("--all-frames", help="Measure on glitches too.")] = False,
    hands: Annotated[
        list[Path] | None,
        typer.Option(help="BVH of another take: its joints hold the puppet's, one by one; repeatable."),
    ] = None,
    reference: Annotated[
        Path | None, typer.Option(help="Folder of the training takes: what the dancer ever did.")
    ] = None,
    joint: Annotated[
        list[str] | None,
        typer.Option(help="Joint to hold; repeatable; left out: arms, head, chest and a thigh."),
    ] = None,
    iterations: Annotated[
        list[str] | None,
        typer.Option(help="K/J, coding and interaction iterations; repeatable; left out: 1/1 to 30/29."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="PNG: the phrase, the arm pasted on, the dancer's answer.")
    ] = None,
) -> None:
    """Measure how well a network knows a dance, and with --hands whether its body answers a held joint."""
    with clear_errors("evaluate"):
        from appliance.studio import evaluate_command

        evaluate_command.run(
            evaluate_command.Wish(
                network=network,
                recordings=recordings,
                true_fps=true_fps,
                as_json=json,
                all_frames=all_frames,
                hands=tuple(hands or ()),
                reference=reference,
                joints=tuple(joint or ()),
                iterations=tuple(iterations or ()),
                picture=picture,
            )
        )


@app.command()
def export(
    checkpoint: Annotated[Path, typer.Argument(help="checkpoint.pt of a training.")],
    out: Annotated[Path, typer.Option(help="Folder of the show; what the artist wrote there stays.")],
    recordings: Recordings = None,
    phrase: Phrase = None,
    name: Annotated[
        str | None, typer.Option(help="What the show is called; left out: as its folder.")
    ] = None,
) -> None:
    """Make a show of a checkpoint: network file, quantization gate, report, skeleton, phrase, checksums."""
    with clear_errors("export"):
        from appliance.studio import export_command

        export_command.run(checkpoint, out, recordings, phrase, name)


app.add_typer(improvise_command.app)
app.add_typer(experiment_command.app)
app.add_typer(granular_command.app)
