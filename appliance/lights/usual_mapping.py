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
_COLOURS = [(0.25, 0.45, 1.0), (1.0, 0.85, 0.7), (1.0, 0.3, 0.05)]  # alone, answering, far from its phrase


def with_usual_mapping(config: LightsConfig, patch: Patch, skeleton: Skeleton) -> LightsConfig:
    """A show's lights; with the usual mapping where it has fixtures and no mapping."""
    if config.mappings or not config.fixtures:
        return config
    return config.model_copy(update={"mappings": [usual_mapping(config.fixtures, patch, skeleton)]})


def usual_mapping(fixtures: Sequence[FixtureConfig], patch: Patch, skeleton: Skeleton) -> MappingConfig:
    """Lamps on the dancer's left follow the left hand and foot in turn, those on the right the right ones.

    Brightness: a slow base from the whole body's motion, and an accent where the lamp's limb is fast. Colour:
    how strongly the body answers the hand. Heads aim at their limb, those in the middle at the chest.
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
    if len(patch.select([], COLOUR)):
        rules.append(_rule(reads="answer", drives=COLOUR, colours=_COLOURS, attack_s=0.6, release_s=1.5))
    return MappingConfig(name=NAME, rules=rules)


def _rule(**values: object) -> RuleConfig:
    return RuleConfig.model_validate(values)
