"""box.yaml as typed, bounded configuration: what the venue needs; without a file, all on loopback."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, field_validator, model_validator

from appliance.show.control import ControlConfig
from appliance.show.dmx import DmxWires
from appliance.show.posistagenet import PosiStageNetConfig
from appliance.show.projector import ProjectorConfig
from appliance.show.section import Ipv4, LocalFile, Section, refusal
from appliance.show.validation import validated
from appliance.show.venue_lights import VenueLightsConfig
from appliance.show.yaml_file import read_yaml

Dialect = Literal["ai-toolbox", "joint", "vmc"]
Resume = Literal["always", "after_crash", "never"]


class UdpConfig(Section):
    """Where sensors' datagrams arrive."""

    host: Ipv4 = Field(
        default="127.0.0.1",
        description="Address to listen on. Wearables on Wi-Fi need 0.0.0.0: they call everybody on the "
        "network, and no other address hears that.",
    )
    port: int = Field(default=9750, ge=0, le=65535, description="UDP port; 0 takes any free one.")


class SerialConfig(Section):
    """A sensor on a cable."""

    device: str = Field(min_length=1, max_length=200, description="The serial device, like /dev/ttyACM0.")
    baud: int = Field(default=115200, ge=1200, le=4_000_000, description="Speed in baud.")


class SensorsConfig(Section):
    """How sensors reach the box."""

    udp: UdpConfig | None = Field(
        default_factory=UdpConfig, description="Sensors over the network; null: none."
    )
    serial: list[SerialConfig] = Field(default_factory=list, max_length=8, description="Sensors on cables.")
    keys: LocalFile | None = Field(
        default=None,
        description="File with the sensors' keys, relative to the box file; null: none is let in.",
    )
    light: bool = Field(
        default=True,
        description="A short flash of a sensor's lamp each 3 seconds says that it is linked; false: it stays "
        "dark on stage. Lights that ask for something are shown all the same.",
    )


def out_of_reach(sensors: SensorsConfig) -> str | None:
    """Why wearables on Wi-Fi do not reach the box, and what to do; None when they do.

    Their hello is a broadcast, which the kernel gives to sockets on 0.0.0.0 alone.
    """
    udp = sensors.udp
    if udp is not None and udp.host == "0.0.0.0":
        return None
    where = "to no network" if udp is None else f"on {udp.host} alone, and they call everybody on the network"
    if udp is not None and udp.host.startswith("127."):
        where = "to this machine alone"
    port = udp.port if udp is not None and udp.port else UdpConfig().port
    return (
        f"No wearable on Wi-Fi reaches the box: it listens {where}. "
        f"Write `udp: {{host: 0.0.0.0, port: {port}}}` under sensors in the box file."
    )


class OscConfig(Section):
    """One receiver of the dancer's joints."""

    host: Ipv4 = Field(default="127.0.0.1", description="The receiver's address in numbers.")
    port: int = Field(
        default=9004, ge=1, le=65535, description="The receiver's UDP port; VMC: usually 39539."
    )
    dialect: Dialect = Field(
        default="ai-toolbox", description="The messages that it understands; docs/osc.md shows them."
    )
    frame_message: bool = Field(
        default=False, description="Send /bunraku/frame (tick, time, sequence, late) before the joints."
    )


class OutputsConfig(Section):
    """Where the dance goes."""

    osc: list[OscConfig] = Field(
        default_factory=lambda: [OscConfig()], max_length=16, description="Receivers by OSC; [] for none."
    )
    posistagenet: list[PosiStageNetConfig] = Field(
        default_factory=list,
        max_length=8,
        description="Joints' positions by PosiStageNet, for media servers and followspots.",
    )
    dmx: DmxWires = Field(
        default_factory=list, max_length=32, description="Universes of DMX, each on its wire."
    )

    @field_validator("osc")
    @classmethod
    def _each_receiver_once(cls, receivers: list[OscConfig]) -> list[OscConfig]:
        seen = [(receiver.host, receiver.port, receiver.dialect) for receiver in receivers]
        for place, receiver in enumerate(seen):
            if receiver in seen[:place]:
                raise refusal("This receiver stands here twice.", "Remove one, or change its port.", at=place)
        return receivers


class LimitsConfig(Section):
    """How much time the dance may take."""

    tick_budget_ms: float = Field(
        default=10.0,
        ge=0.5,
        le=18,
        description="What one tick of 20 ms may use; a show needing more is refused.",
    )
    late_ms: float = Field(
        default=15.0,
        ge=1,
        le=20,
        description="A frame that leaves later than this after its slot began counts as late.",
    )


class RealtimeConfig(Section):
    """Real-time rights of the stage."""

    enabled: bool = Field(default=True, description="Ask for real-time scheduling and locked memory.")
    priority: int = Field(default=70, ge=1, le=99, description="SCHED_FIFO priority.")


class JournalConfig(Section):
    """The flight recorder."""

    folder: LocalFile | None = Field(
        default=None, description="Folder, relative to the box file; made when missing; null: no journal."
    )
    minutes: float = Field(
        default=30.0, ge=0.1, le=1440, description="How much it keeps before the oldest goes."
    )


class BoxConfig(Section):
    """box.yaml."""

    state: LocalFile | None = Field(
        default=None,
        description="Folder where the box keeps what it learns (neutral poses, sensors' calibrations), "
        "relative to the box file; made when missing; null: the key file's folder.",
    )
    sensors: SensorsConfig = Field(default_factory=SensorsConfig, description=str(SensorsConfig.__doc__))
    outputs: OutputsConfig = Field(default_factory=OutputsConfig, description=str(OutputsConfig.__doc__))
    control: ControlConfig | None = Field(
        default_factory=ControlConfig, description="Where commands by OSC arrive; null: nowhere."
    )
    lights: VenueLightsConfig = Field(
        default_factory=VenueLightsConfig, description=str(VenueLightsConfig.__doc__)
    )
    projector: ProjectorConfig = Field(
        default_factory=ProjectorConfig, description=str(ProjectorConfig.__doc__)
    )
    runtime: LocalFile | None = Field(
        default=None,
        description="Folder where the box's processes meet, relative to the box file; a folder in memory. "
        "null: the one that systemd gives, else one of the user who plays.",
    )
    limits: LimitsConfig = Field(default_factory=LimitsConfig, description=str(LimitsConfig.__doc__))
    realtime: RealtimeConfig = Field(default_factory=RealtimeConfig, description=str(RealtimeConfig.__doc__))
    phase_lock: bool = Field(
        default=True, description="Place each tick just after the primary sensor's usual arrival."
    )
    resume: Resume = Field(
        default="always",
        description="When a show goes on at the place of the phrase where it was: always (after a crash and "
        "after a power cut), after_crash, or never. A show that was ended begins at the beginning.",
    )
    journal: JournalConfig = Field(default_factory=JournalConfig, description=str(JournalConfig.__doc__))

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
    path = Path(path)
    return validated(BoxConfig, read_yaml(path), {"directory": path.resolve().parent})
