"""The process for timecode and MIDI: hears both, and gives show control commands as any desk does."""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from appliance.box.fallback import Fallbacks
from appliance.box.own_process import OwnProcess
from appliance.box.process_health import ProcessHealth
from appliance.box.served import from_here
from appliance.box.show_state import ShowStateReader
from appliance.levers.addresses import ADDRESSES
from appliance.levers.show_state import ShowState
from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.frame_reader import FrameReader
from appliance.remote import art_net_timecode
from appliance.remote.caretaker import Caretaker
from appliance.remote.chase import CueChase, DanceChase, timed_cues
from appliance.remote.code_clock import CodeClock
from appliance.remote.fallback import (
    CLOCK_NOT_SET,
    MIDI_AWAY,
    OF_THE_REMOTE,
    PROJECTOR_AWAY,
    TIMECODE_AWAY,
    TIMECODE_UNHEARD,
)
from appliance.remote.linear_timecode import LtcInput
from appliance.remote.midi_timecode import MidiTimecode
from appliance.remote.network_midi import NetworkMidi
from appliance.remote.raw_midi import RawMidi
from appliance.remote.show_control_messages import command_of
from appliance.remote.timecode import BY_NAME, Rate, at
from appliance.show.box import BoxConfig, load_box
from appliance.show.remote import MidiConfig, TimecodeConfig
from appliance.show_control.midi_bindings import MidiBindings, Moved, moved
from appliance.show_control.packet import Message, datagram
from appliance.show_control.port import Port

_log = logging.getLogger(__name__)

_TURN_S = 0.01  # how often due cues and sound are looked at; MIDI and datagrams wake the process at once
_AT_ONCE = 64
_RETRY_S = 2.0
_LOOK_S = 0.1  # at what the stage says about itself
_OWN_CONTROL_S = 0.5  # a fader that was just moved is not moved against the hand
_NETWORK_NAME = "Bunraku"


class Follower:
    """Cues that follow the code and, where it is asked for, the phrase."""

    def __init__(self, config: TimecodeConfig, give: Callable[[Message], None]) -> None:
        self._config, self._give = config, give
        self.clock = CodeClock(config.freewheel_s)
        self._cues, self._dance = CueChase(), DanceChase(config.tolerance_s)
        self._timed_of: tuple[tuple[Mapping[str, Any], ...], Rate] = (), self.clock.rate
        self._timed: list[tuple[float, str]] = []

    @property
    def error_s(self) -> float:
        """How far the phrase is behind."""
        return self._dance.error_s

    def time_s(self, now: float) -> float | None:
        """Seconds of the code with the offset; None: there is none."""
        time_s = self.clock.time_s(now)
        return None if time_s is None else time_s + self._config.offset_s

    def turn(
        self, cues: tuple[Mapping[str, Any], ...], health: Mapping[str, Any], is_asleep: bool, now: float
    ) -> None:
        """Give what is due. cues: the show's; is_asleep: nothing is danced: stopped, or no stage."""
        time_s = self.time_s(now)
        if is_asleep:
            return
        if (cues, self.clock.rate) != self._timed_of:  # the same objects, as long as it is one show
            self._timed_of = cues, self.clock.rate
            self._timed = timed_cues(*self._timed_of)
        if (due := self._cues.due(time_s, self._timed)) is not None:
            self._give(("/cue", due))
        if self._config.chase != "dance":
            return
        stands = self.clock.state(now) == "standing"
        looked_at = float(health.get("looked_at", now))
        speed = 0.0 if stands else self.clock.speed
        time_at = None
        if time_s is not None:
            time_at = time_s - self._cues.start(time_s) - speed * (now - looked_at)
        for message in self._dance.follow(health, time_at, self.clock.speed, stands, now):
            self._give(message)


class Senders:
    """Receivers of this box's own timecode: the chased one, else the place in the phrase."""

    def __init__(self, config: TimecodeConfig) -> None:
        self._receivers = [
            (
                BY_NAME[f"{one.rate:g}"],
                DatagramSender(f"timecode {one.host}", DatagramPath(one.host, one.port, None, one.broadcast)),
            )
            for one in config.send
        ]
        self._sent = [-1] * len(self._receivers)

    def turn(self, time_s: float | None, now: float) -> None:
        """Send each label once, as its frame begins."""
        if time_s is None:
            return
        for place, (rate, sender) in enumerate(self._receivers):
            label = at(time_s, rate)
            if label.count != self._sent[place]:
                self._sent[place] = label.count
                sender.send_datagrams((art_net_timecode.packed(label),), now)

    def sent(self, address: tuple[str, int]) -> bool:
        """Whether a datagram from there is one of these: broadcasts come back to this machine."""
        return any(sender.source == address for _, sender in self._receivers)

    def close(self) -> None:
        for _, sender in self._receivers:
            sender.close()


class Midi:
    """All of MIDI: cables and network in, bindings, show control and timecode out of it."""

    def __init__(
        self, config: MidiConfig, bindings: MidiBindings, give: Callable[[Message], None], name: str
    ) -> None:
        self._config, self._bindings, self._give = config, bindings, give
        self._raw = None if config.devices is None else RawMidi(config.devices)
        self._name = name
        self._network: NetworkMidi | None = None
        self._retry_at = 0.0
        self.trouble = ""
        self.newest: Moved | None = None
        self._moved_at: dict[tuple[str, str, int, int], float] = {}
        self._shown: dict[tuple[str, str, int, int], int] = {}

    @property
    def devices(self) -> tuple[str, ...]:
        """Names of what is connected."""
        raw = () if self._raw is None else self._raw.names
        return (*raw, *(() if self._network is None else self._network.names))

    @property
    def missing(self) -> tuple[str, ...]:
        """Devices of the box file that are not there."""
        return () if self._raw is None else self._raw.missing

    def descriptors(self) -> list[int]:
        """To poll."""
        raw = [] if self._raw is None else self._raw.descriptors()
        return [*raw, *([] if self._network is None else self._network.descriptors())]

    def look(self, now: float) -> None:
        """Open what has come."""
        if self._raw is not None:
            self._raw.look(now)
        session = self._config.network
        if session is not None and self._network is None and now >= self._retry_at:
            self._retry_at = now + _RETRY_S
            try:
                self._network = NetworkMidi(session.host, session.port, self._name, session.senders)
                self.trouble = ""
            except OSError as error:
                self.trouble = (
                    f"MIDI by network cannot be heard ({error.strerror}): its ports are taken. All that is "
                    "in force stays. Give another `port` under midi: network: in the box file."
                )

    def turn(self, cues: tuple[str, ...], now: float) -> Iterator[tuple[str, bytes]]:
        """Carry out what has come; gives each message and its device on, for the timecode in it."""
        heard = [] if self._raw is None else list(self._raw.messages())
        heard += [] if self._network is None else list(self._network.messages(now))
        for device, message in heard:
            yield device, message
            if (what := moved(device, message)) is not None:
                self.newest, self._moved_at[what.control] = what, now
                commands = list(self._bindings.commands(what))
                for one in commands:
                    self._give(one)
                if what.kind == "program" and not commands and self._config.program_change:
                    self._program(what.number, cues)
            elif message[0] == 0xF0 and (command := self._show_control(message, cues)) is not None:
                self._give(command)

    def show(self, state: ShowState, now: float) -> None:
        """Move motor faders, and light rings, to where the levers are; of a device that comes back all."""
        here = {*self.devices}
        self._shown = {control: value for control, value in self._shown.items() if control[0] in here}
        for one in self._bindings.all:
            lever = ADDRESSES[one.address].lever
            if lever is None or one.kind != "controller" or one.low is None or one.high is None:
                continue
            if one.device not in here or one.name or one.low == one.high:
                continue
            if now - self._moved_at.get(one.control, 0.0) < _OWN_CONTROL_S:
                continue
            number = lever.kind.formatted(state[lever].value)[1]
            if not number:
                continue
            share = (number[0] - one.low) / (one.high - one.low)
            value = round(127 * min(max(share, 0.0), 1.0))
            if self._shown.get(one.control) != value:
                self._shown[one.control] = value
                message = bytes([0xB0 | one.channel - 1, one.number, value])
                if self._raw is not None:
                    self._raw.send(one.device, message)
                if self._network is not None:
                    self._network.send(one.device, message, now)

    def close(self) -> None:
        if self._raw is not None:
            self._raw.close()
        if self._network is not None:
            self._network.close()

    def _show_control(self, message: bytes, cues: tuple[str, ...]) -> Message | None:
        device = self._config.show_control_device
        return None if device is None else command_of(message, device, cues)

    def _program(self, number: int, cues: tuple[str, ...]) -> None:
        if number < len(cues):
            self._give(("/cue", cues[number]))


class Remote:
    """Timecode and MIDI of one box file. Raises OSError where the runtime folder takes no file."""

    def __init__(self, box: BoxConfig, folder: Path, fallbacks: Fallbacks) -> None:
        control = box.control
        assert control is not None  # the box file was checked
        self._box, self._fallbacks = box, fallbacks
        self._to = from_here(control.host), control.port
        self._desk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._desk.setblocking(False)
        self._stage, self._state = FrameReader(folder), ShowStateReader(folder)
        timecode = box.timecode or TimecodeConfig()
        self._timecode = timecode
        self.follower = Follower(timecode, self._give)
        self._senders = Senders(timecode)
        self._midi_codes: dict[str, MidiTimecode] = {}  # by device: one code may come by several
        self._ltc = LtcInput(timecode.device) if timecode.source == "ltc" else None
        self._port: Port | None = None
        self._retry_at = 0.0
        self._bindings_in = (box.state_folder or folder).absolute()
        bindings = MidiBindings(self._bindings_in)
        self.midi = None if box.midi is None else Midi(box.midi, bindings, self._give, _NETWORK_NAME)
        hours = box.hours
        self.caretaker = None if hours is None else Caretaker(hours, folder, self._give, time.time)
        self._processes = ProcessHealth(folder)
        self.trouble = ""
        self._said = ""
        self._was_heard = False
        self._health: dict[str, Any] = {}
        self._look_at = 0.0

    def descriptors(self) -> list[int]:
        """To poll."""
        midi = [] if self.midi is None else self.midi.descriptors()
        return [*midi, *([] if self._port is None else [self._port.fileno()])]

    def turn(self, now: float) -> None:
        """Hear what has come, and give what is due; monotonic seconds."""
        self._open(now)
        facts = self._stage.facts
        cues = () if facts is None else facts.cues
        names = tuple(str(cue["name"]) for cue in cues)
        if self.midi is not None:
            self.midi.look(now)
            for device, message in self.midi.turn(names, now):
                if self._timecode.source != "mtc":
                    continue
                code = self._midi_codes.setdefault(device, MidiTimecode())
                if (heard := code.hear(message)) is not None:
                    self.follower.clock.hear(heard.label, now, heard.ahead_frames)
            for gone in self._midi_codes.keys() - {*self.midi.devices}:
                del self._midi_codes[gone]
        self._hear_art_net(now)
        if self._ltc is not None:
            for heard, ended in self._ltc.labels(now):
                self.follower.clock.hear(heard.label, ended, heard.ahead_frames)
        if now >= self._look_at:
            self._look_at = now + _LOOK_S
            self._stage.newest(now)
            self._health = self._stage.health() or {}
        state, is_alive, health = self._state.read(), self._stage.is_alive(now), self._health
        self.follower.turn(cues, health, not state.going or not is_alive, now)
        if self.midi is not None:
            self.midi.show(state, now)
        if self.caretaker is not None:
            live = str(self._processes.reported("control", now).get("live", ""))
            self.caretaker.turn(state, health if is_alive else {}, live, now)
        self._senders.turn(self._own_time_s(health, is_alive, now), now)

    def report(self, now: float) -> dict[str, Any]:
        """The report for page and status; notes the fallbacks too."""
        clock = self.follower.clock
        label = self.follower.time_s(now)
        state = clock.state(now) if self._timecode.source else ""
        self._was_heard = self._was_heard or state not in ("absent", "locking", "")
        self.trouble = self._ltc.trouble if self._ltc is not None else self.trouble
        self._fallbacks.set(TIMECODE_AWAY.name, self._was_heard and state == "absent")
        self._fallbacks.set(TIMECODE_UNHEARD.name, self.trouble or (self.midi.trouble if self.midi else ""))
        missing = () if self.midi is None else self.midi.missing
        self._fallbacks.set(MIDI_AWAY.name, bool(missing))
        self._fallbacks.concern(MIDI_AWAY.name, missing)
        self._look_after_house()
        if self.trouble != self._said:
            self._said = self.trouble
            if self.trouble:
                _log.warning(self.trouble)
            else:
                _log.info("Timecode can be heard again.")
        newest = None if self.midi is None else self.midi.newest
        return {
            "timecode": "" if label is None else str(at(label, clock.rate)),
            "state": state,
            "rate": clock.rate.name,
            "error_s": round(self.follower.error_s, 3),
            "midi": [] if self.midi is None else list(self.midi.devices),
            "bindings": "" if self.midi is None else str(self._bindings_in),
            "moved": None if newest is None else newest._asdict(),
            "hours": None if self.caretaker is None else self.caretaker.report(),
        }

    def _look_after_house(self) -> None:
        if self.caretaker is not None:
            troubles = self.caretaker.troubles()
            self._fallbacks.set(PROJECTOR_AWAY.name, bool(troubles))
            self._fallbacks.concern(PROJECTOR_AWAY.name, troubles)
            self._fallbacks.set(CLOCK_NOT_SET.name, not self.caretaker.knows_the_time)

    def close(self) -> None:
        parts = (self._port, self._ltc, self.midi, self.caretaker, self._senders)
        for one in (*parts, self._processes, self._stage, self._state, self._desk):
            if one is not None:
                one.close()

    def _open(self, now: float) -> None:
        timecode = self._timecode
        if timecode.source != "art-net" or self._port is not None or now < self._retry_at:
            return
        self._retry_at = now + _RETRY_S
        try:
            opened = art_net_timecode.open_port(timecode.host, timecode.port)
        except OSError as error:
            self.trouble = (
                f"UDP port {timecode.port} on {timecode.host} cannot be opened for timecode "
                f"({error.strerror}). Cues wait for a GO by hand. Stop the program that has it, or give "
                "another `port` under timecode in the box file."
            )
            return
        self._port, self.trouble = Port(opened, timecode.senders), ""

    def _hear_art_net(self, now: float) -> None:
        for _ in range(_AT_ONCE):
            found = None if self._port is None else self._port.take()
            if found is None:
                return
            if self._senders.sent(found[1]):
                continue
            with contextlib.suppress(ValueError):
                if (label := art_net_timecode.label_in(found[0])) is not None:
                    self.follower.clock.hear(label, now)

    def _own_time_s(self, health: Mapping[str, Any], is_alive: bool, now: float) -> float | None:
        """Seconds of the code that is sent: the one that is chased, else where the phrase is."""
        if (time_s := self.follower.time_s(now)) is not None:
            return time_s
        led = next((one for one in health.get("puppets", ()) if one.get("is_led")), None)
        if led is None or not is_alive:
            return None
        stands = health.get("state") == "stopped"
        since = 0.0 if stands else now - float(health.get("looked_at", now))
        return max(float(led["position_s"]) + since, 0.0)

    def _give(self, message: Message) -> None:
        with contextlib.suppress(OSError):
            self._desk.sendto(datagram(message), self._to)


def run_remote(box_file: Path | None) -> None:
    """Hear timecode and MIDI until a signal comes. Raises ConfigError, RuntimeFolderError."""
    box = load_box(box_file)
    with OwnProcess(box, "remote", OF_THE_REMOTE) as own:
        remote = own.keep(Remote(box, own.folder, own.fallbacks))
        own.notifier.ready("Timecode and MIDI are heard.")
        report_at = 0.0
        while not own.stopped():
            with contextlib.suppress(OSError, ValueError):  # a device that was unplugged meanwhile
                select.select(remote.descriptors(), (), (), _TURN_S)
            now = time.monotonic()
            remote.turn(now)
            if now >= report_at:
                report_at = now + _LOOK_S
                own.health.reported = remote.report(now)
            own.pulse(now)
