"""The strings of show.yaml and the sound card of box.yaml."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from appliance.show.section import Section, key

BOWED_SAMPLES = 32  # from one push of the bow to the next: 1500 a second at 48 kHz
Name = Annotated[str, Field(min_length=1, max_length=64)]


Scale = Annotated[
    list[Annotated[int, Field(ge=0, le=11)]], Field(min_length=1, max_length=12), Field(strict=False)
]


class StringsConfig(Section):
    """Strings that the dance plays: one for each bone, driven by its motion, coupled where bones meet."""

    cues: list[Name] = key("Cues in which they sound; []: always.", [], length=(0, 200))
    of: Literal["body", "hand", "live", "couplings"] = key(
        "Whose motion plays them. body: the first puppet's; hand: the turns of its first hand, all strings; "
        "live: the live dancer's; couplings: each sounds as far as the joint at its bone's end moves as that "
        "of another figure does, or as the hand's joint.",
        "body",
    )
    preset: Literal["strings", "voices", "percussion"] = key(
        "strings: bowed and struck; voices: bowed, with the resonances of a mouth; percussion: struck bars.",
        "strings",
    )
    harmonies: list[Scale] = key(
        "Scales, semitones above the base. Each cue of the show has the next one, and a figure that is down "
        "on the floor the one after that; rising, it has its own again.",
        [[0, 2, 4, 7, 9], [0, 3, 5, 7, 10], [0, 2, 5, 7, 9]],
        length=(1, 8),
    )
    attacks: float = key("How loud starts of moves and footfalls are struck.", 0.5, within=(0, 1))
    base_hz: float = key("Pitch of the longest bone; shorter ones are higher.", 110.0, within=(30, 1000))
    partials: int = key("How many partials each string has.", 6, within=(1, 12))
    brightness: float = key("How loud each partial is beside the one below it.", 0.6, within=(0, 1))
    decay_s: float = key("Seconds in which a string falls by 60 dB.", 3.0, within=(0.05, 30))
    coupling: float = key("How strongly strings of bones that meet sound along.", 0.02, within=(0, 0.2))
    volume: float = key("How loud they are.", 0.5, within=(0, 1))


class SoundConfig(Section):
    """Where the strings are heard (`bunraku sound`)."""

    device: str | int | None = key(
        "The sound card: (part of) its name, or its number; null: the system's own choice.", None
    )
    channels: Literal[2, 8] = key("Loudspeakers: a pair, or eight in a ring around the stage.", 2)
    rate: int = key("Samples a second.", 48000, within=(22050, 96000))
    block: int = key(
        "Samples computed at once: fewer answer sooner, more drop out later; a multiple of 32. A card that "
        "gets them too late again and again is given twice as many, up to 512.",
        128,
        within=(64, 1024),
    )

    @field_validator("block")
    @classmethod
    def _whole_steps(cls, block: int) -> int:
        return block // BOWED_SAMPLES * BOWED_SAMPLES
