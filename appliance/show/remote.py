"""box.yaml's timecode and MIDI: where they come from, and what follows them."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, model_validator

from appliance.show.control import Senders
from appliance.show.section import Ipv4, Section, key, refusal

_TIMECODE = re.compile(r"([01]?\d|2[0-3]):[0-5]\d:[0-5]\d(?:[:;.][0-2]\d)?")


def _timecode(text: str) -> str:
    if _TIMECODE.fullmatch(text) is None:
        raise refusal(
            f"'{text}' is no timecode.", 'Write hours, minutes, seconds and frames, like "01:00:10:00".'
        )
    return text


def _rate(rate: float) -> float:
    if rate not in (24.0, 25.0, 29.97, 30.0):
        raise refusal(f"No timecode has {rate:g} frames a second.", "Write 24, 25, 29.97 or 30.")
    return rate


CueTime = Annotated[str, AfterValidator(_timecode)]


def _require_senders(host: str, senders: list[str], what: str) -> None:
    if not host.startswith("127.") and not senders:
        raise refusal(
            f"{what} is heard on {host}, but no sender is listed.",
            "List the desk: `senders: [192.168.0.20]`, or a whole network `[192.168.0.0/24]`.",
            at="host",
        )


class TimecodeSendConfig(Section):
    """A receiver of this box's timecode by Art-Net: where the phrase is."""

    host: Ipv4 = key("The receiver's IP address, or a broadcast address with `broadcast: true`.")
    port: int = key("UDP port.", 6454, within=(1, 65535))
    broadcast: bool = key("true: the address is a network's broadcast address.", False)
    rate: Annotated[float, AfterValidator(_rate)] = key("Frames a second: 24, 25, 29.97 or 30.", 25.0)


class TimecodeConfig(Section):
    """A timecode that the show follows."""

    source: Literal["art-net", "mtc", "ltc"] | None = key(
        "art-net: Art-Net timecode; mtc: MIDI timecode, over the MIDI that `midi` takes; ltc: an audio track "
        "at a sound input. null: none comes, this box only sends.",
        None,
    )
    host: Ipv4 = key("art-net: address to listen on; broadcasts only reach 0.0.0.0.", "127.0.0.1")
    port: int = key("art-net: UDP port.", 6454, within=(1, 65535))
    senders: list[Senders] = key(
        "art-net: addresses or networks that are heard. This machine always is.", [], length=(0, 32)
    )
    device: str | int | None = key(
        "ltc: (part of) the sound input's name, or its number; null: the system's own choice.", None
    )
    chase: Literal["cues", "dance"] = key(
        "cues: each cue with an `at` is called at that time; dance: the phrase keeps in step with the code "
        "too.",
        "cues",
    )
    offset_s: float = key("Seconds that are added to what comes.", 0.0, within=(-86400, 86400))
    freewheel_s: float = key("How long the code goes on when it stays away.", 2.0, within=(0, 60))
    tolerance_s: float = key(
        "How far the phrase may be from the code before it jumps; less is taken away by its speed.",
        0.5,
        within=(0.1, 10),
    )
    send: list[TimecodeSendConfig] = key("Receivers of this box's timecode.", [], length=(0, 8))

    @model_validator(mode="after")
    def _heard(self) -> TimecodeConfig:
        if self.source == "art-net":
            _require_senders(self.host, self.senders, "Art-Net timecode")
        if self.source != "ltc" and self.device is not None:
            raise refusal("`device` is the sound input of ltc.", "Remove this line.", at="device")
        return self


class NetworkMidiConfig(Section):
    """A session of MIDI by network (RTP-MIDI), which the computer or tablet opens."""

    host: Ipv4 = key("Address to listen on.", "127.0.0.1")
    port: int = key(
        "UDP port of the session; MIDI itself comes to the one above it.", 5004, within=(1, 65534)
    )
    senders: list[Senders] = key(
        "Addresses or networks that may open it. This machine always may.", [], length=(0, 32)
    )

    @model_validator(mode="after")
    def _heard(self) -> NetworkMidiConfig:
        _require_senders(self.host, self.senders, "MIDI")
        return self


class MidiConfig(Section):
    """Controllers and desks that speak MIDI."""

    devices: list[Annotated[str, AfterValidator(str.strip)]] | None = key(
        "Parts of the devices' names, or paths like /dev/snd/midiC1D0; []: every one that is plugged in; "
        "null: none.",
        [],
        length=(0, 16),
    )
    network: NetworkMidiConfig | None = key("MIDI by network; null: none.", None)
    show_control_device: int | None = key(
        "Number of this box for MIDI Show Control (GO, STOP, ...); null: not taken.", 1, within=(0, 111)
    )
    program_change: bool = key("Whether program change n calls up the n-th cue, 1 first.", True)
