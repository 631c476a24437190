"""The mapping of a rig without rules: each lamp follows a limb, so that an audience sees what moves it."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.lights.patch import Patch
from appliance.pose.roles import roles_of
from appliance.pose.skeleton import Skeleton
from appliance.show.fixture_profile import DIMMER
from appliance.show.light_rules import AIM, COLOUR, MappingConfig, RuleConfig
from appliance.show.lights import FixtureConfig, LightsConfig

NAME = "usual"
_MIDDLE_M = 0.3  # lamps nearer to the middle than this follow the body
_LOW_M = 1.0  # lamps lower than this stand on the floor
_BEHIND_M = 0.3  # lamps farther upstage than this shine from behind, those farther downstage from the front
# Three colours a role: no answer, some, the strongest. Light from the front stays pale enough to show a face.
_COLOURS = {
    "front": [(0.7, 0.8, 1.0), (1.0, 0.9, 0.75), (1.0, 0.65, 0.35)],
    "side": [(0.1, 0.75, 0.85), (0.9, 0.6, 0.8), (1.0, 0.25, 0.3)],
    "back": [(0.15, 0.25, 1.0), (0.7, 0.35, 0.9), (1.0, 0.3, 0.05)],
}


def with_usual_mapping(config: LightsConfig, patch: Patch, skeleton: Skeleton) -> LightsConfig:
    """A show's lights; with the usual mapping where it has fixtures and no mapping."""
    if config.mappings or not config.fixtures:
        return config
    return config.model_copy(update={"mappings": [usual_mapping(config.fixtures, patch, skeleton)]})


def usual_mapping(fixtures: Sequence[FixtureConfig], patch: Patch, skeleton: Skeleton) -> MappingConfig:
    """Lamps on the dancer's left follow the left hand and foot in turn, those on the right the right ones.

    Brightness: a slow base from the whole body's motion, and an accent where the lamp's limb is fast. Colour:
    how strongly the body answers the hand, from the front, the sides and behind each in its own range. Heads
    aim at their limb, those in the middle at the chest.
    """
    roles = {role: skeleton.names[joint] for role, joint in roles_of(skeleton.names).items()}
    middle = roles.get("chest", skeleton.names[0])
    turns = {"left": 0, "right": 0}
    rules = [
        _rule(reads="qom", drives=DIMMER, range=(0.1, 1.0), output=(0.1, 0.5), attack_s=1.5, release_s=3.0)
    ]
    accents = []
    for fixture in fixtures:
        side = "left" if fixture.place[0] > _MIDDLE_M else "right" if fixture.place[0] < -_MIDDLE_M else ""
        limb = middle
        if side:
            limb = roles.get(f"{side} {('hand', 'foot')[turns[side] % 2]}", middle)
            turns[side] += 1
        if any(head.fixture.name == fixture.name for head in patch.heads.heads):
            accents.append(_rule(fixtures=[fixture.name], reads="place", joint=limb, drives=AIM))
        if len(patch.select([fixture.name], DIMMER)):
            accents.append(
                _rule(
                    fixtures=[fixture.name],
                    reads="speed",
                    joint=limb,
                    drives=DIMMER,
                    range=(0.6, 3.0),
                    curve="s",
                    mix="highest",
                )
            )
    rules = [rule for rule in rules if len(patch.select([], rule.drives))] + accents
    for role, colours in _COLOURS.items():
        names = [one.name for one in fixtures if _role(one) == role and len(patch.select([one.name], COLOUR))]
        if names:
            fades = {"attack_s": 0.6, "release_s": 1.5}
            rules.append(_rule(reads="answer", drives=COLOUR, fixtures=names, colours=colours, **fades))
    return MappingConfig(name=NAME, rules=rules)


def _role(fixture: FixtureConfig) -> str:
    """From where it lights the dancer. Lamps on the floor count as side light: they are seen as an accent."""
    _, height, depth = fixture.place
    if depth < -_BEHIND_M:
        return "back"
    return "front" if depth > _BEHIND_M and height > _LOW_M else "side"


def _rule(**values: object) -> RuleConfig:
    return RuleConfig.model_validate(values)
