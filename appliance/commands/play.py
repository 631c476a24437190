"""`bunraku play`: load, say what will dance, dance, say what was danced."""

from __future__ import annotations

import shutil
import socket
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

from appliance.commands.companions import Companion, Companions
from appliance.commands.control import control_command, open_control_port
from appliance.commands.emulation import Emulation
from appliance.commands.rehearsal import PICTURED_S, has_display, rehearsal_picture
from appliance.control.house import forget_house
from appliance.control.speaker import Speaker
from appliance.control.stop_signals import stop_signals
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.show import Show, load_show
from appliance.stage.cast import reach
from appliance.stage.run import Stage

_NO_REFUSAL = ("accepted", "relocated", "hello", "profile", "lost", "reboot", "drain_limit")
# In a technician's words; what is not here goes by its name in docs/wire.md.
_REFUSALS = {
    "no packets of ours": ("length", "magic", "version", "kind"),
    "from sensors without a key": ("device",),
    "forged or damaged": ("tag",),
    "of an earlier link": ("old_session", "old_hello"),
    "doubled or too late": ("duplicate", "reordered", "old"),
    "no orientation that a hand could have": ("zero", "norm", "torn", "rate"),
    "damaged on the cable": ("frame_length", "frame_stuffing", "frame_crc"),
}


def play_show(
    directory: Path | None = None,
    box_file: Path | None = None,
    seconds: float | None = None,
    emulate: bool = False,
    journal: Path | None = None,
    filmstrip: Path | None = None,
    alone: bool = False,
    window: bool = False,
    rehearse: Path | None = None,
) -> int:
    """Dance until the seconds are over or a signal comes; the exit status.

    alone: start no companions. window: show the projection in a window. rehearse: the same where there is
    a display, and a picture of the projection at the end.
    """
    show, box = load_show(directory or default_show_path()), load_box(box_file)
    with ExitStack() as opened:
        stopped = opened.enter_context(stop_signals())
        scratch = Path(tempfile.mkdtemp(prefix="bunraku-"))
        opened.callback(shutil.rmtree, scratch, ignore_errors=True)
        if emulate:
            emulation = opened.enter_context(Emulation(show, box, scratch))
            box = emulation.box
        journal = journal or box.journal.folder
        if (filmstrip or rehearse) is not None and journal is None:
            journal = scratch / "dance.journal"
            box = _with_short_journal(box)
        speaker = Speaker()
        opened.callback(speaker.close)
        shown = rehearse is not None and has_display()
        control = None if alone or box.control is None else open_control_port(box.control)
        if control is not None:
            opened.callback(control.close)
        stage = Stage(show, box, journal, speaker.say, box_file)
        with closing(stage):
            for line in _introduction(stage, emulate, control):
                speaker.say(line)
            company = () if alone else tuple(_company(show, box, box_file, control, window or shown))
            with Companions(company, speaker.say, lambda: stage.health.ticks > 0):
                stage.dance(seconds, stopped)
        if not alone:
            forget_house(stage.sharing.folder)
        for line in _conclusion(stage):
            speaker.say(line)
        if filmstrip is not None and journal is not None:
            from appliance.commands.pictures import danced, drawn

            picture = drawn(danced(journal).part(-PICTURED_S, PICTURED_S), filmstrip)
            speaker.say(f"What was just danced, held joints highlighted: {picture}")
        if rehearse is not None and journal is not None:
            for line in rehearsal_picture(journal, rehearse, show):
                speaker.say(line)
    return 0


def _company(
    show: Show, box: BoxConfig, box_file: Path | None, control: socket.socket | None, window: bool
) -> Iterator[Companion]:
    """Who accompanies the stage."""
    if control is not None:
        yield Companion(
            "Show control",
            control_command(box, control.fileno()),
            "What is in force stays in force; commands wait for a moment.",
            descriptors=(control.fileno(),),
        )
    named = () if box_file is None else ("--box", str(box_file))
    bunraku = (sys.executable, "-m", "appliance.cli")
    if box.outputs.dmx and show.config.lights.fixtures:
        yield Companion(
            "The process for the lights",
            (*bunraku, "lights", *named),
            "The lights stay as they are for a moment.",
        )
    if window:
        yield Companion(
            "The projector",
            (*bunraku, "project", *named, "--window"),
            "The picture is black for a moment.",
            may_close=True,
        )


def _introduction(stage: Stage, emulate: bool, control: socket.socket | None) -> list[str]:
    show = stage.show
    hands = ", ".join(f"{hand.sensor or hand.kind} holds {hand.joint}" for hand in show.config.hands)
    receivers = ", ".join(receiver.name for receiver in stage.cast.outputs.receivers) or "nobody"
    lines = [
        f"{show.config.name}: {hands or 'no hands, the dancer moves freely'}.",
        f"The dance goes to {receivers}.",
        _ears(stage, control),
        stage.admission.sentence(),
    ]
    lines += stage.cast.complaints
    if not emulate:
        lines += reach(stage.cast, stage.box)
    return lines


def _ears(stage: Stage, control: socket.socket | None) -> str:
    """Where sensors and commands are heard."""
    sensors = ", ".join(intake.name for intake in stage.cast.link.intakes) or "no port"
    if control is not None:
        commands = "on " + ":".join(map(str, control.getsockname()))
    else:
        commands = "by nobody" if stage.box.control is None else "by a process of their own (bunraku control)"
    return f"Sensors are heard on {sensors}, commands {commands}."


def _conclusion(stage: Stage) -> list[str]:
    health = stage.health
    trouble = "".join(f", {name} {count}" for name, count in health.trouble() if count)
    lines = [
        f"Danced {health.ticks} ticks: late {health.late}, longest tick {health.worst_ms:.1f} ms{trouble}."
    ]
    if stage.cast.worn:
        lines.append(_readings(stage.cast.link.counts))
    return lines


def _readings(counts: dict[str, int]) -> str:
    """What became of the sensors' packets, refusals by reason."""
    accepted = counts["accepted"] + counts["relocated"]
    words = {reason: words for words, reasons in _REFUSALS.items() for reason in reasons}
    refused: dict[str, int] = {}
    for reason, count in counts.items():
        if count and reason not in _NO_REFUSAL:
            said = words.get(reason, reason)
            refused[said] = refused.get(said, 0) + count
    lost = f", {counts['lost']} lost on the way" if counts["lost"] else ""
    reasons = ", ".join(f"{count} {said}" for said, count in refused.items())
    return f"Readings: {accepted} accepted{lost}" + (f"; refused: {reasons}." if refused else ".")


def _with_short_journal(box: BoxConfig) -> BoxConfig:
    """A journal that only serves the picture at the end keeps little more than what is drawn."""
    return box.model_copy(update={"journal": box.journal.model_copy(update={"minutes": 0.5})})
