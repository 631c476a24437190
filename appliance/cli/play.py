"""`bunraku play`: load, announce, dance, and report what was danced."""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from appliance.box.live_pose import forget_live_pose
from appliance.box.log import SAID, Trouble, log_sentence, process_log
from appliance.box.made_motion import forget_made_motion
from appliance.box.runtime_folder import restored_file
from appliance.box.show_state import forget_show_state
from appliance.box.stop_signals import stop_signals
from appliance.sensor.memory import forget_memory
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path, named_show
from appliance.show.control import ControlConfig
from appliance.show.show import Show, ShowConfig, load_show
from appliance.show.venue_rig import unwired
from appliance.stage.open_sensors import reach
from appliance.stage.run import Stage
from appliance.stage.stage_error import StageError

if TYPE_CHECKING:
    from appliance.cli.companions import Companion
    from appliance.outputs.datagram_sender import DatagramSender

_log = logging.getLogger(__name__)

_NO_REFUSAL = ("accepted", "hello", "profile", "lost", "reboot", "drain_limit")
# In a technician's words; a reason that is missing here keeps its name from docs/wire.md.
_REFUSALS = {
    "no packets of ours": ("length", "magic", "version", "kind"),
    "from sensors without a key": ("device",),
    "forged or damaged": ("tag",),
    "from an earlier link": ("old_session", "old_hello"),
    "doubled or too late": ("duplicate", "reordered", "old"),
    "without an orientation": ("norm",),
    "damaged on the cable": ("frame_length", "frame_stuffing", "frame_crc"),
}

PICTURED_MINUTES = 0.5  # a journal for the picture at the end keeps little more than is drawn
_REHEARSAL = (
    "A rehearsal with emulated sensors: the box's own place, journal and sensor memory stay as they are."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayOptions:
    """The options of `bunraku play`, by the names that they have there.

    show: its folder or name; None: the default show. box: the box file; None: all at its default. Neither
    may be given with `chosen`, the file of what the preflight chose and proved. seconds: None: until a signal
    comes. emulate: emulate the sensors; the box keeps nothing of them. journal: its folder; None: the box
    file's. filmstrip: draw the dance into this PNG at the end. alone: start no companions. window: show the
    projection in a window. rehearse: the same where there is a display, and render the dance into this PNG
    at the end. cue: begin in this one. phone: a phone is the show's first sensor.
    """

    show: Path | None = None
    box: Path | None = None
    seconds: float | None = None
    emulate: bool = False
    journal: Path | None = None
    filmstrip: Path | None = None
    alone: bool = False
    window: bool = False
    rehearse: Path | None = None
    chosen: Path | None = None
    cue: str | None = None
    phone: bool = False


class _Keeping(NamedTuple):
    """keeps: whether a keeper runs, which writes the journal and the box's place to the disk. journal: its
    folder; None: no journal. minutes: how much of it stays.
    """

    keeps: bool
    journal: Path | None
    minutes: float


@dataclass(frozen=True, slots=True)
class _Prepared:
    """A stage that is ready to dance, and what was opened for it.

    scratch: a folder that is removed with this process; None: nothing needs one. control, page: their ports,
    if their processes are started here.
    """

    stage: Stage
    stopped: Callable[[], bool]
    scratch: Path | None
    keeping: _Keeping
    window: bool
    control: socket.socket | None
    page: socket.socket | None


def play_show(options: PlayOptions) -> int:
    """Dance until the seconds are over or a signal comes; returns the exit status.

    Raises ConfigError, StageError.
    """
    if options.chosen is not None:
        options = _chosen_to_dance(options.chosen, options)
    show, box = _load(options)
    proof = _proof(options, show)
    with ExitStack() as opened:
        prepared = _prepare(options, show, box, opened)
        with closing(prepared.stage):
            _dance(options, prepared, proof)
        _conclude(options, prepared)
    if options.chosen is not None:
        from appliance.release.trial import ended_well

        ended_well(options.chosen)
    return 0


def _chosen_to_dance(chosen: Path, options: PlayOptions) -> PlayOptions:
    """With the show and the box file that the preflight chose; their start is counted."""
    from appliance.release.choice import require_no
    from appliance.release.trial import chosen_to_dance

    require_no("--show", options.show, chosen)
    require_no("--box", options.box, chosen)
    with process_log():
        pair = chosen_to_dance(chosen, time.monotonic())
    return replace(options, show=pair.show, box=pair.box)


def _load(options: PlayOptions) -> tuple[Show, BoxConfig]:
    show, box = load_show(named_show(options.show) or default_show_path()), load_box(options.box)
    if not options.phone:
        return show, box
    from appliance.cli.phones import with_phone

    return show, with_phone(show.config, box)


def _proof(options: PlayOptions, show: Show) -> str:
    """Run the network of a named show once; sentences for the user. Not inside stop_signals: a network that
    never ends would block every signal.
    """
    if options.show is None or options.chosen is not None:
        return ""
    from appliance.cli.network_proof import prove_network

    return prove_network(show)


def _prepare(options: PlayOptions, show: Show, box: BoxConfig, opened: ExitStack) -> _Prepared:
    """Open the log, the ports and the stage; the caller closes the stage, and `opened` all else."""
    stopped = opened.enter_context(stop_signals())
    log = opened.enter_context(process_log())  # closed first: a second Ctrl-C cuts no line off
    scratch = _scratch(opened) if options.emulate or options.filmstrip or options.rehearse else None
    if options.emulate and scratch:
        from appliance.cli.emulation import emulated

        box = opened.enter_context(emulated(show.config, box, scratch))
    keeping = _keeping(options, box, scratch)
    if options.chosen is not None:
        opened.enter_context(restored_file(options.chosen))
    window = options.window
    if options.rehearse is not None:
        from appliance.cli.rehearsal import has_display

        window = has_display() or window
    control = None if options.alone or box.control is None else _opened(box.control, opened)
    if options.cue is not None:
        from appliance.cli.control import begin_in

        begin_in(options.cue, show, control)
    page = None
    if box.console is not None and not options.alone:
        from appliance.cli.page_address import open_console_port

        page = opened.enter_context(open_console_port(box.console, or_any=True))
    stage = Stage(show, box, box.path, rehearsal=options.emulate)
    log.keep_in(stage.sharing.folder / SAID)
    return _Prepared(stage, stopped, scratch, keeping, window, control, page)


def _keeping(options: PlayOptions, box: BoxConfig, scratch: Path | None) -> _Keeping:
    """Raises StageError for a journal that is a file."""
    if options.journal is not None:
        return _Keeping(True, _new_folder(options.journal), box.journal.minutes)
    journal = box.journal.folder
    pictured = options.filmstrip is not None or options.rehearse is not None
    if pictured and scratch and (options.alone or journal is None):
        return _Keeping(True, scratch / "dance.journal", PICTURED_MINUTES)
    has_place = box.state_folder is not None and not options.emulate
    return _Keeping(not options.alone and (journal is not None or has_place), journal, box.journal.minutes)


def _dance(options: PlayOptions, prepared: _Prepared, proof: str) -> None:
    """Introduce the show, start what runs beside the stage, dance, and keep what was danced."""
    stage, scratch, control = prepared.stage, prepared.scratch, prepared.control
    show, box, (keeps, journal, minutes) = stage.show.config, stage.box, prepared.keeping
    keepers_box = _rehearsal_box(stage, scratch) if options.emulate and scratch else box.path
    keeper = _keeper(keepers_box, journal, minutes) if keeps else None
    unlit = () if options.alone or show.lights.fixtures else map(Trouble, unwired(show, box))
    for line in (*proof.splitlines(), *_introduction(stage, options.emulate, control), *unlit):
        log_sentence(_log, line)
    companions = () if options.alone else tuple(_companions(show, box, control, prepared.window))
    if prepared.page is not None:
        from appliance.cli.console import page_companion

        companions += (page_companion(box, prepared.page, control, options.emulate, journal),)
    if options.emulate and scratch:
        from appliance.cli.emulation import wait_until_calling

        wait_until_calling(scratch)
    with _running(companions + (() if keeper is None else (keeper,)), stage):
        stage.dance(options.seconds, prepared.stopped)
    if keeper is not None:
        from appliance.keeper.keeper import keep_rest

        keep_rest(box, stage.sharing.noted, journal, minutes)


def _conclude(options: PlayOptions, prepared: _Prepared) -> None:
    """After the stage is closed: the next show begins anew; say and draw what was danced."""
    if not options.alone:
        _forget_run(prepared.stage)
    for line in _conclusion(prepared.stage):
        _log.info(line)
    journal = prepared.keeping.journal
    if options.filmstrip is not None and journal is not None:
        from appliance.cli.pictures import draw_dance, load_dance
        from appliance.cli.rehearsal import PICTURED_S

        picture = draw_dance(load_dance(journal).part(-PICTURED_S, PICTURED_S), options.filmstrip)
        _log.info(f"The dance just now, held joints highlighted: {picture}")
    if options.rehearse is not None and journal is not None:
        from appliance.cli.rehearsal import rehearsal_picture

        for line in rehearsal_picture(journal, options.rehearse, prepared.stage.show):
            _log.info(line)


def _scratch(opened: ExitStack) -> Path:
    """A folder that is removed with this process."""
    import shutil
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix="bunraku-"))
    opened.callback(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _rehearsal_box(stage: Stage, scratch: Path) -> Path:
    """The box file of a rehearsal's keeper: only the rehearsal's runtime folder, nothing of the venue."""
    path = scratch / "keeper.yaml"
    path.write_text(f"runtime: {json.dumps(str(stage.sharing.noted))}\n")
    return path


def _opened(control: ControlConfig, opened: ExitStack) -> socket.socket:
    from appliance.cli.control import open_control_port

    port = open_control_port(control)
    opened.callback(port.close)
    return port


def _running(companions: tuple[Companion, ...], stage: Stage) -> AbstractContextManager[object]:
    """A context in which they run; without any, their module is not loaded, so that a stage restarts fast."""
    if not companions:
        return nullcontext()
    from appliance.cli.companions import Companions

    return Companions(companions, lambda: stage.health.ticks > 0)


def _companions(
    show: ShowConfig, box: BoxConfig, control: socket.socket | None, window: bool
) -> Iterator[Companion]:
    """The processes beside the stage."""
    from appliance.box.notify import WATCHDOG_S
    from appliance.cli.companions import Companion
    from appliance.cli.control import control_command

    if control is not None:
        yield Companion(
            "Show control",
            control_command(box, control.fileno()),
            "What is in force stays in force; commands wait for a moment.",
            descriptors=(control.fileno(),),
            watchdog_s=WATCHDOG_S["control"],
        )
    if show.motion.made_sources:
        yield _companion("generator", "The generator", "The last phrase plays on.", box.path, "generate")
    if box.outputs.dmx and show.lights.fixtures:
        meanwhile = "The lights stay as they are for a moment."
        yield _companion("lights", "The process for the lights", meanwhile, box.path, "lights")
    if window and show.strings and (box.path is None or box.sound):
        meanwhile = "The strings are silent for a moment."
        yield _companion("sound", "The process for the sound", meanwhile, box.path, "sound")
    if box.timecode is not None or box.midi is not None or box.hours is not None:
        meanwhile = "Cues wait for a GO by hand."
        yield _companion("remote", "The process for timecode and MIDI", meanwhile, box.path, "remote")
    if window:
        meanwhile = "The picture is black for a moment."
        projector = _companion("projector", "The projector", meanwhile, box.path, "project", "--window")
        yield replace(projector, may_close=True)


def _companion(process: str, name: str, meanwhile: str, box: Path | None, *command: str) -> Companion:
    """A command of `bunraku` beside the stage."""
    from appliance.box.child import BUNRAKU
    from appliance.box.notify import WATCHDOG_S
    from appliance.cli.companions import Companion

    named = () if box is None else ("--box", str(box))
    return Companion(name, (*BUNRAKU, *command, *named), meanwhile, watchdog_s=WATCHDOG_S[process])


def _forget_run(stage: Stage) -> None:
    """After a clean end the next show starts from its beginning."""
    folder = stage.sharing.folder
    forget_show_state(folder)
    forget_live_pose(folder)
    forget_made_motion(folder)
    if stage.box.state_folder is not None:
        forget_memory(stage.sharing.noted, stage.box.state_folder)


def _keeper(box_file: Path | None, journal: Path | None, minutes: float) -> Companion:
    """The process that writes the journal, the checkpoint and the sensors' memory to the disk."""
    recording = () if journal is None else ("--journal", str(journal), "--minutes", str(minutes))
    meanwhile = "Meanwhile the journal waits in memory."
    return _companion("keeper", "The keeper", meanwhile, box_file, "keep", *recording)


def _new_folder(journal: Path) -> Path:
    """Refuse a file: a journal is a folder."""
    if journal.is_file():
        raise StageError(
            f"{journal} is a file, and a journal is a folder. Nothing is danced. Name another place, or "
            "remove the file."
        )
    return journal


def _introduction(stage: Stage, emulate: bool, control: socket.socket | None) -> list[str]:
    show = stage.show
    hands = ", ".join(
        f"{hand.sensor or hand.kind} hold{'' if hand.springs else 's'} {hand.joint}"
        + ("" if hand.from_start else " when a cue says so")
        for hand in show.config.hands
    )
    receivers = ", ".join(map(_receiver, stage.parts.outputs.receivers)) or "no receiver"
    lines = [
        f"{show.config.name}: {hands or 'no hands, the dancer moves freely'}.",
        f"The dance goes to {receivers}.",
        _inputs(stage, control),
        stage.admission.sentence(),
    ]
    lines += map(Trouble, stage.parts.complaints)
    lines += map(Trouble, map(str, (*show.doubtful_hands(), *show.doubtful_strings())))
    if (hours := stage.box.hours) is not None:
        lines += hours.unknown_cues([cue.name for cue in show.config.cues])
    if emulate:
        lines.append(_REHEARSAL)
    else:
        lines += reach(list(stage.parts.worn), stage.box)
    return lines


def _receiver(one: DatagramSender) -> str:
    return one.name if one.is_asked_for else f"{one.name}, should a program listen there"


def _inputs(stage: Stage, control: socket.socket | None) -> str:
    """Where sensors and commands arrive."""
    sensors = ", ".join(intake.name for intake in stage.parts.link.intakes) or "no port"
    if control is not None:
        commands = "on " + ":".join(map(str, control.getsockname()))
    else:
        commands = "nowhere" if stage.box.control is None else "by another process (bunraku control)"
    return f"Sensors are heard on {sensors}, commands {commands}."


def _conclusion(stage: Stage) -> list[str]:
    health = stage.health
    trouble = "".join(f", {name} {count}" for name, count in health.trouble() if count)
    lines = [
        f"Danced {health.ticks} ticks: late {health.late}, longest tick {health.worst_ms:.1f} ms{trouble}."
    ]
    if stage.parts.worn:
        lines.append(readings_line(stage.parts.link.counts))
    return lines


def readings_line(counts: dict[str, int]) -> str:
    """Counts of the sensors' packets: accepted, lost, refused by reason."""
    meanings = {reason: meaning for meaning, reasons in _REFUSALS.items() for reason in reasons}
    refused: dict[str, int] = {}
    for reason, count in counts.items():
        if count and reason not in _NO_REFUSAL:
            said = meanings.get(reason, reason)
            refused[said] = refused.get(said, 0) + count
    lost = f", {counts['lost']} lost on the way" if counts["lost"] else ""
    reasons = ", ".join(f"{count} {said}" for said, count in refused.items())
    return f"Readings: {counts['accepted']} accepted{lost}" + (f"; refused: {reasons}." if refused else ".")
