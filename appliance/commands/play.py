"""`bunraku play`: load, say what will dance, dance, say what was danced."""

from __future__ import annotations

import shutil
import tempfile
from contextlib import ExitStack
from pathlib import Path

from appliance.commands.emulation import Emulation
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.stage.cast import reach
from appliance.stage.run import Stage, stop_signals
from appliance.control.speaker import Speaker

_PICTURED_S = 10.0
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
    directory: Path | None,
    box_file: Path | None,
    seconds: float | None,
    emulate: bool,
    journal: Path | None,
    filmstrip: Path | None,
) -> int:
    """Dance until the seconds are over or a signal comes; the exit status."""
    show, box = load_show(directory or default_show_path()), load_box(box_file)
    with ExitStack() as opened:
        stopped = opened.enter_context(stop_signals())
        scratch = Path(tempfile.mkdtemp(prefix="bunraku-"))
        opened.callback(shutil.rmtree, scratch, ignore_errors=True)
        if emulate:
            emulation = opened.enter_context(Emulation(show, box, scratch))
            box = emulation.box
        journal = journal or box.journal.file
        if filmstrip is not None and journal is None:
            journal = scratch / "dance.journal"
            box = _with_short_journal(box)
        speaker = Speaker()
        opened.callback(speaker.close)
        stage = Stage(show, box, journal, speaker.say)
        try:
            for line in _introduction(stage, emulate):
                speaker.say(line)
            stage.dance(seconds, stopped)
        finally:
            stage.close()
        for line in _conclusion(stage):
            speaker.say(line)
        if filmstrip is not None and journal is not None:
            from appliance.commands.pictures import picture_of_journal

            picture = picture_of_journal(journal, filmstrip, -_PICTURED_S, _PICTURED_S)
            speaker.say(f"What was just danced, held joints highlighted: {picture}")
    return 0


def _introduction(stage: Stage, emulate: bool) -> list[str]:
    show = stage.show
    hands = ", ".join(f"{hand.sensor or hand.kind} holds {hand.joint}" for hand in show.config.hands)
    receivers = ", ".join(receiver.name for receiver in stage.cast.outputs.receivers) or "nobody"
    lines = [
        f"{show.config.name}: {hands or 'no hands, the dancer moves freely'}.",
        f"The dance goes to {receivers}.",
        _ears(stage),
        stage.admission.sentence(),
    ]
    lines += stage.cast.complaints
    if not emulate:
        lines += reach(stage.cast, stage.box)
    return lines


def _ears(stage: Stage) -> str:
    """Where sensors and commands are heard."""
    sensors = ", ".join(intake.name for intake in stage.cast.link.intakes) or "no port"
    control = stage.box.control
    commands = f"{control.host}:{stage.control.port}" if control is not None and stage.control else "no port"
    return f"Sensors are heard on {sensors}, commands on {commands}."


def _conclusion(stage: Stage) -> list[str]:
    health = stage.health
    trouble = "".join(f", {name} {count}" for name, count in health.trouble() if count)
    lines = [
        f"Danced {health.ticks} ticks: late {health.late}, longest tick {health.worst_ms:.1f} ms{trouble}."
    ]
    if stage.cast.worn:
        lines.append(_readings(stage.cast.link.counts))
    if stage.control is not None and stage.control.refused:
        lines.append(f"Commands: {stage.control.refused} refused, the last one: {stage.control.reason}")
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
