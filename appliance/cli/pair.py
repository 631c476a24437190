"""`bunraku pair`: how the two boxes of a pair are, the lead back by hand, and the pair's secret."""

from __future__ import annotations

import os
import secrets
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from appliance.box.runtime_folder import runtime_folder
from appliance.cli.options import ThisBoxFile
from appliance.cli.sensors.control_client import ControlClient, NoBoxError
from appliance.outputs.frame_reader import FrameReader
from appliance.release.installed_box import box_here
from appliance.sensor.wire import KEY_BYTES
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import NotAskedForError, Problem

pair = typer.Typer(
    help="Two boxes for one show: the second follows the first, and takes over when it is silent. "
    "`status` also says whether boxes in step are so.",
    no_args_is_help=True,
)
_ROLES = {"waits": "waits for the other one", "follows": "follows", "leads": "leads", "yields": "gives back"}


@pair.command()
def status(box: ThisBoxFile = None) -> None:
    """Tell which box leads, and whether the other one could take over; status 1 when it could not.

    On boxes in step: which one leads, and which follow it; status 1 when one does not.
    """
    config = _paired(box, or_locked=True)
    reported = reported_pair(config)
    if reported is None:
        print("No stage dances on this box, so nothing is known of its pair. Start it: bunraku play.")
        raise typer.Exit(1)
    print(sentence(reported))
    raise typer.Exit(0 if is_well(reported) else 1)


@pair.command()
def back(box: ThisBoxFile = None) -> None:
    """Let the other box lead again: at the box that leads, once the other one follows."""
    try:
        answer = ControlClient.of(_paired(box)).ask("/pair/back")
    except NoBoxError as error:
        print(error)
        raise typer.Exit(1) from None
    print(answer.message)
    raise typer.Exit(0 if answer.done else 1)


@pair.command()
def secret(
    file: Annotated[Path, typer.Argument(help="Written there; the other box needs the same file.")],
) -> None:
    """Draw the pair's secret and write it to a new file that only this user can read."""
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        print(f"{file} is there already, and stays as it is: both boxes need the same secret.")
        raise typer.Exit(1) from None
    with os.fdopen(descriptor, "w") as out:
        out.write(secrets.token_hex(KEY_BYTES) + "\n")
    print(f"{file}: name it as `secret:` under `pair:` in the box file, and copy it to the other box.")


def reported_pair(config: BoxConfig) -> dict[str, Any] | None:
    """The stage's report about its pair, or about the boxes in step with it; None where no stage dances."""
    reader = FrameReader(runtime_folder(config))
    try:
        if not reader.is_alive(time.monotonic()):
            return None
        health = reader.health() or {}
        reported: dict[str, Any] | None = health.get("pair") or health.get("in_step")
    finally:
        reader.close()
    return reported


def is_well(reported: dict[str, Any]) -> bool:
    """Whether the other box could take over; or whether all boxes are in step."""
    if "boxes" in reported:
        return all(one["in_step"] for one in reported["boxes"])
    return bool(reported["peer"] and reported["ready"])


def sentence(reported: dict[str, Any]) -> str:
    if "boxes" in reported:
        return _in_step(reported)
    role = _ROLES.get(str(reported["role"]), str(reported["role"]))
    other = "second" if reported["box"] == "first" else "first"
    if not reported["peer"]:
        state = f"The {other} one is not heard: nobody would take over."
    elif not reported["same_show"]:
        state = f"The {other} one has another show or release: it cannot follow."
    elif not reported["ready"]:
        state = "The one that follows is not ready yet."
    else:
        state = "The one that follows could take over at any moment."
    changes = (
        f"Takeovers by this box: {reported['takeovers']}; lead changed {max(0, reported['epoch'] - 1)} times."
    )
    return f"This is the {reported['box']} box of the pair, and it {role}. {state} {changes}"


def _in_step(reported: dict[str, Any]) -> str:
    behind, boxes = reported["behind"], reported["boxes"]
    if behind is None:
        sentences = [
            f"This box leads. In step with it: {sum(one['in_step'] for one in boxes)} of {len(boxes)}."
        ]
    elif boxes[0]["in_step"]:
        sentences = [f"This box dances in step with {boxes[0]['at']}, {behind} ticks behind it."]
    else:
        sentences = ["This box dances by itself."]
    for one in (one for one in boxes if not one["in_step"]):
        if not one["same_show"]:
            sentences.append(f"{one['at']} has another show, release or secret.")
        elif one["silent_s"] is None:
            sentences.append(f"{one['at']} has not been heard.")
        elif one["silent_s"] > 1.0:
            sentences.append(f"{one['at']} has been silent for {one['silent_s']:.0f} s.")
        else:
            sentences.append(f"{one['at']} is heard, and not in step yet.")
    return " ".join(sentences)


def _paired(box: Path | None, or_locked: bool = False) -> BoxConfig:
    config = load_box(box_here(box, None))
    if config.pair is None and not (or_locked and config.locked):
        cure = "Write it: docs/pair.md has an example."
        raise NotAskedForError([Problem(config.file.path, 0, "This box file has no `pair:`.", cure)])
    return config
