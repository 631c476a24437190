"""box.yaml as typed, bounded configuration: what the venue needs; without a file, all on loopback."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import PrivateAttr, field_validator, model_validator

from appliance.show.config_error import Problem
from appliance.show.console import ConsoleConfig
from appliance.show.control import ControlConfig
from appliance.show.dmx import DmxWires
from appliance.show.foreign_sensors import MOST as MOST_FOREIGN
from appliance.show.foreign_sensors import ForeignSensorConfig
from appliance.show.locked import LockedConfig
from appliance.show.opening_hours import HoursConfig
from appliance.show.osc import OscConfig, osc_misfits
from appliance.show.pair import PairConfig
from appliance.show.posistagenet import PosiStageNetConfig, misfits
from appliance.show.projector import ProjectorConfig
from appliance.show.remote import MidiConfig, TimecodeConfig
from appliance.show.section import (
    Ipv4,
    LocalFile,
    LocalFolder,
    Section,
    SerialDevice,
    key,
    part,
    refusal,
    refuse_repeats,
)
from appliance.show.sound import SoundConfig
from appliance.show.validation import validated
from appliance.show.venue_lights import VenueLightsConfig
from appliance.show.yaml_file import YamlFile, read_yaml

Resume = Literal["always", "after_crash", "never"]


class UdpConfig(Section):
    """Where sensors' datagrams arrive."""

    host: Ipv4 = key(
        "Address to listen on. Wearables on Wi-Fi need 0.0.0.0: they broadcast, and "
        "no other address receives that.",
        "127.0.0.1",
    )
    port: int = key("UDP port; 0: any free one.", 9750, within=(0, 65535))


class SerialConfig(Section):
    """A sensor on a cable."""

    device: SerialDevice = key("The serial device, like /dev/ttyACM0.", length=(1, 200))
    baud: int = key("Speed in baud.", 115200, within=(1200, 4_000_000))


class SensorsConfig(Section):
    """How sensors reach the box."""

    udp: UdpConfig | None = key("Sensors over the network; null: none.", UdpConfig())
    serial: list[SerialConfig] = key("Sensors on cables.", [], length=(0, 8))
    keys: LocalFile | None = key(
        "File with the sensors' keys, relative to the box file; null: no sensor is let in.", None
    )
    foreign: list[ForeignSensorConfig] = key(
        "Phones and programs in place of wearables.", [], length=(0, MOST_FOREIGN)
    )
    rate_hz: Literal[50, 100] = key(
        "Readings a second that each wearable is asked for. At 100 a lost or late one costs 10 ms instead of "
        "20; it needs more battery, and Wi-Fi that carries it.",
        50,
    )
    heading: Literal["auto", "button"] = key(
        "auto: drift of the sensors' headings is estimated while they dance, and taken out slowly; button: "
        "only a neutral pose or a heading reset corrects it.",
        "auto",
    )
    light: bool = key(
        "A short flash of a sensor's lamp every 3 seconds shows that it is linked; false: it stays "
        "dark on stage. Signals that ask for something are still shown.",
        True,
    )

    @field_validator("foreign")
    @classmethod
    def _each_name_once(cls, foreign: list[ForeignSensorConfig]) -> list[ForeignSensorConfig]:
        cure = "Give each sensor a name by itself."
        refuse_repeats([one.name for one in foreign], "Two foreign sensors are called '{value}'.", cure)
        return foreign

    @field_validator("foreign")
    @classmethod
    def _mocopi_by_itself(cls, foreign: list[ForeignSensorConfig]) -> list[ForeignSensorConfig]:
        """mocopi's datagrams are not OSC: a port is read as one or the other."""
        mocopi = {one.usual_port: one.name for one in foreign if one.from_ == "mocopi"}
        for place, one in enumerate(foreign):
            if one.program is not None and one.from_ != "mocopi" and one.usual_port in mocopi:
                raise refusal(
                    f"Port {one.usual_port} is for mocopi ({mocopi[one.usual_port]}), and {one.name} from "
                    f"{one.from_} would not be heard there: a port takes mocopi's datagrams or OSC.",
                    "Give one of them another `port`, also in the program that sends.",
                    at=place,
                )
        return foreign


def out_of_reach(sensors: SensorsConfig) -> str | None:
    """Why wearables on Wi-Fi do not reach the box, and what to do; None when they do.

    Their hello is a broadcast, which the kernel delivers only to sockets on 0.0.0.0.
    """
    udp = sensors.udp
    if udp is not None and udp.host == "0.0.0.0":
        return None
    where = "to no network" if udp is None else f"on {udp.host} only, and their hello is a broadcast"
    if udp is not None and udp.host.startswith("127."):
        where = "to this machine only"
    port = udp.port if udp is not None and udp.port else UdpConfig().port
    return (
        f"No wearable on Wi-Fi reaches the box: it listens {where}. "
        f"Write `udp: {{host: 0.0.0.0, port: {port}}}` under sensors in the box file."
    )


class OutputsConfig(Section):
    """Where the dance goes."""

    osc: list[OscConfig] = key("Receivers by OSC; [] for none.", [OscConfig()], length=(0, 16))
    posistagenet: list[PosiStageNetConfig] = key(
        "Joints' positions by PosiStageNet, for media servers and followspots.", [], length=(0, 8)
    )
    dmx: DmxWires = key("Universes of DMX, each on its wire.", [], length=(0, 32))

    @field_validator("osc")
    @classmethod
    def _each_receiver_once(cls, receivers: list[OscConfig]) -> list[OscConfig]:
        seen = [(receiver.host, receiver.port, receiver.dialect) for receiver in receivers]
        refuse_repeats(seen, "This receiver is listed twice.", "Remove one, or change its port.")
        return receivers


class LimitsConfig(Section):
    """How much time the dance may take."""

    tick_budget_ms: float = key(
        "Time for one 20 ms tick. On stage a show that needs more runs with fewer iterations, and the "
        "box says so; `bunraku check` refuses it. At power-on a new show is refused only where a single "
        "iteration is too much.",
        10.0,
        within=(0.5, 18),
    )
    wait_ms: float = key(
        "How long a tick waits for a reading of the primary sensor that is late; 0: it takes the one before, "
        "which is a tick old. The wait ends before the frame would count as late.",
        10.0,
        within=(0, 15),
    )
    late_ms: float = key(
        "A frame that leaves later than this after its slot began counts as late.", 15.0, within=(1, 20)
    )


class RealtimeConfig(Section):
    """Real-time rights of the stage."""

    enabled: bool = key("Ask for real-time scheduling and locked memory.", True)
    priority: int = key("SCHED_FIFO priority.", 70, within=(1, 99))


class JournalConfig(Section):
    """The flight recorder."""

    folder: LocalFolder | None = key(
        "Folder, relative to the box file; created if missing; null: no journal.", None
    )
    minutes: float = key("Minutes kept before the oldest are deleted.", 30.0, within=(0.1, 1440))


class BoxConfig(Section):
    """box.yaml."""

    _file: YamlFile | None = PrivateAttr(default=None)
    state: LocalFolder | None = key(
        "Folder for the box's learned data (neutral poses, sensors' calibrations), "
        "relative to the box file; created if missing; null: the key file's folder.",
        None,
    )
    sensors: SensorsConfig = part(SensorsConfig)
    outputs: OutputsConfig = part(OutputsConfig)
    control: ControlConfig | None = key("Where commands by OSC arrive; null: nowhere.", ControlConfig())
    console: ConsoleConfig | None = key("The page for technicians; null: none.", ConsoleConfig())
    lights: VenueLightsConfig = part(VenueLightsConfig)
    projector: ProjectorConfig = part(ProjectorConfig)
    sound: SoundConfig | None = key("The sound card for a show's strings; null: none.", None)
    timecode: TimecodeConfig | None = key("Timecode in and out; null: none.", None)
    midi: MidiConfig | None = key("MIDI controllers and desks; null: none.", None)
    hours: HoursConfig | None = key("Opening hours; null: the show always runs.", None)
    runtime: LocalFolder | None = key(
        "Folder shared by the box's processes, relative to the box file; a folder in memory. "
        "null: the one from systemd, otherwise the user's.",
        None,
    )
    limits: LimitsConfig = part(LimitsConfig)
    realtime: RealtimeConfig = part(RealtimeConfig)
    phase_lock: bool = key("Place each tick just after the primary sensor's usual arrival.", True)
    resume: Resume = key(
        "When a show continues where it was in the phrase: always (after a crash and "
        "after a power cut), after_crash, or never. A show that was ended starts from the beginning.",
        "always",
    )
    journal: JournalConfig = part(JournalConfig)
    pair: PairConfig | None = key("A second box that takes over when this one is silent; null: none.", None)
    locked: LockedConfig | None = key("Boxes that dance in step, frame by frame; null: none.", None)

    @model_validator(mode="after")
    def _programs_are_heard(self) -> BoxConfig:
        for place, one in enumerate(self.sensors.foreign):
            at = ("sensors", "foreign", place)
            if one.program is None:
                if self.console is None:
                    message = f"{one.name} is a phone, and this box serves no page."
                    raise refusal(message, "Remove `console: null`.", at=at)
                continue
            if self.control is None:
                message = f"Show control hears {one.from_}, and this box has none."
                raise refusal(message, "Remove `control: null`.", at=at)
            ports = {self.control.port: "commands"}
            ports |= {} if self.sensors.udp is None else {self.sensors.udp.port: "wearables"}
            ports |= {} if self.pair is None else {self.pair.port: "the other box"}
            ports |= {} if self.locked is None else {port: "boxes in step" for _, port in self.locked.ends}
            if one.usual_port in ports:
                message = f"Port {one.usual_port} hears {ports[one.usual_port]} already."
                raise refusal(message, f"Give {one.name} another one.", at=(*at, "port"))
        return self

    @model_validator(mode="after")
    def _follows_one_way(self) -> BoxConfig:
        if self.pair is not None and self.locked is not None:
            raise refusal(
                "A box of a pair is silent while it follows, and one in step with others is not.",
                "Remove `pair` or `locked`.",
                at="locked",
            )
        return self

    @model_validator(mode="after")
    def _commands_are_heard(self) -> BoxConfig:
        for name in ("timecode", "midi", "hours"):
            if getattr(self, name) is not None and (self.control is None or not self.control.port):
                raise refusal(
                    f"`{name}` gives commands to show control, and this box has no port for them.",
                    f"Write `control: {{port: {ControlConfig().port}}}`.",
                    at=name,
                )
        timecode = self.timecode
        if timecode is not None and timecode.source == "mtc" and self.midi is None:
            raise refusal("MIDI timecode comes by MIDI.", "Add `midi: {}`.", at=("timecode", "source"))
        return self

    @model_validator(mode="after")
    def _a_port_for_each(self) -> BoxConfig:
        udp, control = self.sensors.udp, self.control
        if udp is None or control is None or not udp.port or udp.port != control.port:
            return self
        if udp.host == control.host or "0.0.0.0" in (udp.host, control.host):
            raise refusal(
                f"Commands and sensors cannot both arrive on port {control.port}.",
                f"Give one of them another port, like {ControlConfig().port} for commands and "
                f"{UdpConfig().port} for sensors.",
                at=("control", "port"),
            )
        return self

    def output_misfits(self, joints: Sequence[str], puppets: int = 1) -> list[Problem]:
        """Where its outputs do not fit this number of puppets with these joints."""
        outputs = self.outputs
        return [
            *misfits(outputs.posistagenet, joints, puppets, self.file),
            *osc_misfits(outputs.osc, joints, puppets, self.file),
        ]

    @property
    def file(self) -> YamlFile:
        """The file that it was read from, with its lines; empty without one."""
        return self._file or YamlFile(Path("box.yaml"))

    @property
    def path(self) -> Path | None:
        """Where that file is; None without one."""
        return None if self._file is None else self._file.path

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BoxConfig) and dict(self) == dict(other)  # wherever it was read from

    @property
    def state_folder(self) -> Path | None:
        """Where the box keeps what it learns; None: nowhere, it has neither a folder nor a key file."""
        return self.state or (self.sensors.keys.parent if self.sensors.keys is not None else None)


def load_box(path: Path | str | None) -> BoxConfig:
    """Read a box file; without one, everything at its default. Files in it are relative to its folder.

    Raises ConfigError with file, line, what is wrong and what to do, for all that is wrong at once.
    """
    if path is None:
        return BoxConfig()
    file = read_yaml(Path(path))
    box = validated(BoxConfig, file, {"directory": file.path.resolve().parent})
    box._file = file
    return box
