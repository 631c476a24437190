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
from appliance.stage.speaker import Speaker

_PICTURED_S = 10.0
_NO_REFUSAL = ("accepted", "relocated", "hello", "profile", "lost", "reboot", "drain_limit")


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
        stage.admission.sentence(),
    ]
    lines += stage.cast.complaints
    if not emulate:
        lines += reach(stage.cast, stage.box)
    return lines


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
    """What became of the sensors' datagrams, refusals by reason."""
    accepted = counts["accepted"] + counts["relocated"]
    refused = {reason: count for reason, count in counts.items() if count and reason not in _NO_REFUSAL}
    reasons = ", ".join(f"{reason} {count}" for reason, count in refused.items())
    lost = f", {counts['lost']} lost on the way" if counts["lost"] else ""
    return f"Readings: {accepted} accepted{lost}" + (f"; refused: {reasons}." if refused else ".")


def _with_short_journal(box: BoxConfig) -> BoxConfig:
    """A journal that only serves the picture at the end keeps little more than what is drawn."""
    return box.model_copy(update={"journal": box.journal.model_copy(update={"minutes": 0.5})})
