"""Lights of a show: fixtures with their addresses and places, mappings, the safe look."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import ValidationInfo, field_validator

from appliance.show.config_error import did_you_mean
from appliance.show.fixture_profile import (
    COLOURS,
    DIMMER,
    LAMPS,
    PAN,
    TILT,
    base,
    load_profile,
    profile_refusal,
)
from appliance.show.light_rules import AIM, COLOUR, Colour, MappingConfig, RuleConfig, TwoNumbers
from appliance.show.section import Section, key, part, refusal, refuse_repeats
from appliance.show.venue_lights import (
    MAX_FIXTURES,
    UNIVERSE_CHANNELS,
    Address,
    Degrees,
    Metres,
    Pose,
    Universe,
)


class FixtureConfig(Section):
    """One fixture of the rig: what it is, where it listens, where it hangs."""

    name: str = key("Name for rules, cues and pictures.", length=(1, 64))
    profile: str = key(
        "Its profile: a file in the show's folder `profiles`, or a built-in one.", length=(1, 100)
    )
    mode: str | None = key("Mode of the profile; default: its first one.", None)
    universe: Universe = key("Its universe; box.yaml assigns the wire.", 1)
    address: Address = key("Its first channel, as on the fixture's display.")
    place: Metres = key(
        "Its place, metres: x to the dancer's left, y up, z towards the audience; the origin "
        "is the phrase's own, on the floor.",
        (0.0, 3.0, 0.0),
    )
    pose: Pose = key("Hanging from a bar, or standing on its base.", "hanging")
    turn: Degrees = key(
        "Its rotation from there, in degrees: yaw about the vertical, pitch about x, roll about z.",
        (0.0, 0.0, 0.0),
    )
    pan_limits: TwoNumbers | None = key(
        "Pan stays between these degrees from its middle; default: its range.", None
    )
    tilt_limits: TwoNumbers | None = key(
        "Tilt stays between these degrees from its middle; default: its range.", None
    )
    invert_pan: bool = key("Pan is inverted here.", False)
    invert_tilt: bool = key("Tilt is inverted here.", False)

    @field_validator("profile")
    @classmethod
    def _known_profile(cls, name: str, info: ValidationInfo) -> str:
        fault = profile_refusal(name, _directory(info))
        if fault is not None:
            raise fault
        return name

    @field_validator("mode")
    @classmethod
    def _known_mode(cls, name: str | None, info: ValidationInfo) -> str | None:
        if name is not None and "profile" in info.data:
            modes = [mode.name for mode in load_profile(info.data["profile"], _directory(info)).modes]
            if name not in modes:
                raise refusal(
                    f"The profile '{info.data['profile']}' has no mode '{name}'.", did_you_mean(name, modes)
                )
        return name

    @field_validator("address")
    @classmethod
    def _ends_within_the_universe(cls, address: int, info: ValidationInfo) -> int:
        if "profile" in info.data and "mode" in info.data:
            profile = load_profile(info.data["profile"], _directory(info))
            count = len(profile.mode(info.data["mode"]).channels)
            if address + count - 1 > UNIVERSE_CHANNELS:
                raise refusal(
                    f"'{info.data.get('name')}' takes {count} channels and would end on channel "
                    f"{address + count - 1}; a universe has {UNIVERSE_CHANNELS}.",
                    f"Write an address of at most {UNIVERSE_CHANNELS + 1 - count}, or another universe.",
                )
        return address

    @field_validator("pan_limits", "tilt_limits")
    @classmethod
    def _in_order(cls, limits: tuple[float, float] | None) -> tuple[float, float] | None:
        if limits is not None and limits[0] >= limits[1]:
            raise refusal(f"{list(limits)} leaves no room to move.", "Write [lowest, highest] in degrees.")
        return limits


class SafeConfig(Section):
    """The safe look: on panic, after a stop, when the stage is lost, at the end. Dark unless set here."""

    dimmer: float = key("Brightness; 0 is dark.", 0.0, within=(0, 1))
    colour: Colour = key("Red, green, blue from 0 to 1.", (1.0, 1.0, 1.0))
    fixtures: list[str] = key("Fixtures that shine then; []: all of them.", [], length=(0, MAX_FIXTURES))
    heads: Literal["hold", "home"] = key(
        "Moving heads stay where they point, or go to their default.", "hold"
    )


class LightsConfig(Section):
    """The rig: fixtures, how the dance drives them, and what they show when nothing dances."""

    fixtures: list[FixtureConfig] = key("The patch.", [], length=(0, MAX_FIXTURES))
    mappings: list[MappingConfig] = key(
        "Sets of rules; the first is in force at the start.", [], length=(0, 64)
    )
    safe: SafeConfig = part(SafeConfig)

    @field_validator("fixtures")
    @classmethod
    def _each_channel_once(cls, fixtures: list[FixtureConfig], info: ValidationInfo) -> list[FixtureConfig]:
        names = [fixture.name for fixture in fixtures]
        refuse_repeats(names, "Two fixtures are called '{value}'.", "Give one another name.")
        for place, message, cure in overlaps(fixtures, _directory(info)):
            raise refusal(message, cure, at=place)
        return fixtures

    @field_validator("mappings")
    @classmethod
    def _rules_fit_the_rig(cls, mappings: list[MappingConfig], info: ValidationInfo) -> list[MappingConfig]:
        names = [mapping.name for mapping in mappings]
        refuse_repeats(names, "Two mappings are called '{value}'.", "Give one another name.")
        for place, mapping in enumerate(mappings):
            for number, rule in enumerate(mapping.rules):
                fault = _misfit(rule, info.data.get("fixtures"), _directory(info))
                if fault is not None:
                    message = f"In the mapping '{mapping.name}': {fault[0]}"
                    raise refusal(message, fault[1], at=(place, "rules", number))
        return mappings

    @field_validator("safe")
    @classmethod
    def _known_fixtures(cls, safe: SafeConfig, info: ValidationInfo) -> SafeConfig:
        names = [fixture.name for fixture in info.data.get("fixtures", ())]
        for name in safe.fixtures:
            if names and name not in names:
                raise refusal(f"There is no fixture '{name}'.", did_you_mean(name, names), at="fixtures")
        return safe


def overlaps(fixtures: Sequence[FixtureConfig], directory: Path | None) -> Sequence[tuple[int, str, str]]:
    """(place in the list, message, cure) of each fixture that sits on another one's channels."""
    owners: dict[tuple[int, int], FixtureConfig] = {}
    found = []
    for place, fixture in enumerate(fixtures):
        count = channel_count(fixture, directory)
        channels = [(fixture.universe, fixture.address + offset) for offset in range(count)]
        taken = next((channel for channel in channels if channel in owners), None)
        if taken is not None:
            other = owners[taken]
            message = (
                f"'{other.name}' and '{fixture.name}' are both on channel {taken[1]} of universe {taken[0]}."
            )
            end = other.address + channel_count(other, directory)
            found.append((place, message, f"'{other.name}' ends on {end - 1}: write another address."))
        owners.update(dict.fromkeys(channels, fixture))
    return found


def channel_count(fixture: FixtureConfig, directory: Path | None) -> int:
    """How many channels a fixture takes in its mode."""
    return len(load_profile(fixture.profile, directory).mode(fixture.mode).channels)


def drivable(fixture: FixtureConfig, directory: Path | None) -> tuple[str, ...]:
    """The values that rules can drive on a fixture: its attributes, `red` for all of `red 1`, ..., aim and
    colour.
    """
    names = list(load_profile(fixture.profile, directory).mode(fixture.mode).attributes)
    bases = {base(name) for name in names}
    if {PAN, TILT} <= bases:
        names.append(AIM)
    if bases & set(COLOURS):
        names.append(COLOUR)
    if bases & {*COLOURS, *LAMPS}:
        names.append(DIMMER)  # colours without a dimmer are scaled in its place
    return tuple(dict.fromkeys([*names, *sorted(bases)]))


def _misfit(
    rule: RuleConfig, fixtures: Sequence[FixtureConfig] | None, directory: Path | None
) -> tuple[str, str] | None:
    """Message and cure when a rule names a fixture or an attribute that there is not."""
    if fixtures is None:
        return None
    by_name = {fixture.name: fixture for fixture in fixtures}
    for name in rule.fixtures:
        if name not in by_name:
            return f"There is no fixture '{name}'.", did_you_mean(name, list(by_name))
        can = drivable(by_name[name], directory)
        if rule.drives not in can:
            return f"The fixture '{name}' has no '{rule.drives}'.", did_you_mean(rule.drives, can)
    everything = sorted({word for fixture in fixtures for word in drivable(fixture, directory)})
    if not rule.fixtures and rule.drives not in everything:
        return f"No fixture has '{rule.drives}'.", did_you_mean(rule.drives, everything)
    return None


def _directory(info: ValidationInfo) -> Path | None:
    directory: Path | None = (info.context or {}).get("directory")
    return directory
