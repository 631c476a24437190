"""The status: how the box is, each field declared once for OSC, the page and the documents."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple, get_type_hints

STATUS = "/bunraku/status"
UNKNOWN = -1.0


class Status(NamedTuple):
    """How the box is. A field's default is what a stage that says nothing about it leaves there."""

    state: Annotated[
        str,
        "`dancing`, `stopped`, `panic`, `blackout`; `hung`: the stage lives, but no frame came for 0.5 s; "
        "`absent`: no stage",
    ] = "absent"
    show: Annotated[str, "name of the show"] = ""
    rate_hz: Annotated[float, "frames a second"] = 0.0
    late: Annotated[int, "frames that left late, since the start"] = 0
    skipped: Annotated[int, "slots that had no frame, since the start"] = 0
    tick_p50_ms: Annotated[float, "time that a tick of the last second took, median"] = 0.0
    tick_p99_ms: Annotated[float, "the same, 99 of 100"] = 0.0
    sensor_age_s: Annotated[float, "age of the primary sensor's newest reading"] = UNKNOWN
    coding: Annotated[int, "coding iterations"] = 0
    interaction: Annotated[int, "interaction iterations"] = 0
    phrase: Annotated[str, "the phrase that the puppet starts from"] = ""
    position_s: Annotated[float, "place in it, seconds"] = UNKNOWN
    cue: Annotated[str, "the newest cue, also while the dance is away; empty: none yet"] = ""
    look: Annotated[str, "the look in force"] = ""
    lights: Annotated[str, "the light mappings in force"] = ""
    level: Annotated[
        float, "brightness of picture and lights now, 0 to 1: master, stop, blackout and panic together"
    ] = 0.0
    panic: Annotated[int, "1: in force"] = 0
    blackout: Annotated[int, "1: in force"] = 0
    temperature_c: Annotated[float, "of the processor"] = UNKNOWN
    uptime_s: Annotated[float, "since the stage began"] = UNKNOWN
    refused: Annotated[
        int, "commands that were not carried out, or not at once, since show control began"
    ] = 0
    strangers: Annotated[int, "datagrams from unlisted senders"] = 0
    fallbacks: Annotated[int, "how many [fallbacks](#fallbacks) are in force now; 0 on a good night"] = 0
    liveliness: Annotated[float, "how alive the answer to a hand is, 0 to 1"] = UNKNOWN
    seed: Annotated[int, "seed of the noise in the answer: the newest that was asked for"] = -1
    timecode: Annotated[str, "the timecode that is followed, like `01:00:10:05`; empty: none comes"] = ""
    live: Annotated[str, "how much of a live dancer comes, like `17 of 17 bones`; empty: none is heard"] = ""

    @classmethod
    def reported(cls, health: Mapping[str, Any]) -> Status:
        """The fields that a stage's health has, with the others at their defaults."""
        return cls(
            **{
                name: kind(health[name])
                for name, (kind, _) in FIELDS.items()
                if isinstance(health.get(name), _TAKEN[kind])
            }
        )

    def messages(self) -> Iterator[tuple[str, str | int | float]]:
        """An address and its argument for each field."""
        for name, value in self._asdict().items():
            yield f"{STATUS}/{name}", value


FIELDS: dict[str, tuple[type, str]] = {  # type and meaning
    name: (hint.__origin__, *hint.__metadata__)
    for name, hint in get_type_hints(Status, include_extras=True).items()
}
TAGS: dict[type, str] = {str: "s", int: "i", float: "f"}
_TAKEN: dict[type, type | tuple[type, ...]] = {str: str, int: int, float: (int, float)}
