"""show.yaml's section about springs: how heavy, stiff and damped the puppet is as a mass-spring body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from appliance.show.section import Section, key, part

Region = Literal["trunk", "head", "arms", "legs"]
STRONGEST_WIND_M_S = 30.0
STRONGEST_GRAVITY_M_S2 = 20.0
Wind = Annotated[
    tuple[
        Annotated[float, Field(ge=-STRONGEST_WIND_M_S, le=STRONGEST_WIND_M_S)],
        Annotated[float, Field(ge=-STRONGEST_WIND_M_S, le=STRONGEST_WIND_M_S)],
        Annotated[float, Field(ge=-STRONGEST_WIND_M_S, le=STRONGEST_WIND_M_S)],
    ],
    Field(strict=False),
]


class RegionConfig(Section):
    """The springs of one region of the body. A bone belongs to the region of the joint that turns it.

    Springs that are too stiff for their masses at 500 steps a second are made as stiff as can be carried.
    """

    mass: float = key("Kilograms at each joint.", 1.0, within=(0.05, 50))
    stiffness: float = key(
        "Stiffness of the spring along each bone, newtons a metre.", 5000.0, within=(0, 1e6)
    )
    directional_stiffness: float = key(
        "Stiffness of the spring that pulls each bone to its direction, newtons a metre: with 1 kg "
        "it swings once a second at 40, three times at 360.",
        60.0,
        within=(0, 1e5),
    )
    damping: float = key(
        "How fast swinging about the phrase's motion dies away, 1/s: after 1 s at 2 a third of the "
        "swing is left.",
        4.0,
        within=(0, 60),
    )


class SpringsConfig(Section):
    """One setting of the springs."""

    name: str = key("Name for hands, cues and `/springs`.", length=(1, 64))
    trunk: RegionConfig = part(RegionConfig)
    head: RegionConfig = part(RegionConfig)
    arms: RegionConfig = part(RegionConfig)
    legs: RegionConfig = part(RegionConfig)
    follow: float = key(
        "Target of the springs: 0 the phrase, 1 the puppet's last pose, which has answered them.",
        0.25,
        within=(0, 1),
    )
    gravity: float = key(
        "Downward acceleration, metres a second^2; the earth's is 9.81.",
        0.0,
        within=(-STRONGEST_GRAVITY_M_S2, STRONGEST_GRAVITY_M_S2),
    )
    wind: Wind = key(
        "Velocity of the air (x, y, z; y is up), metres a second, up to 30 each.", (0.0, 0.0, 0.0)
    )
    gusts: float = key(
        "How much the wind comes and goes: 0 steady, 1 from calm to twice.", 0.0, within=(0, 1)
    )
    air: float = key("How firmly the air drags each mass along, 1/s.", 0.2, within=(0, 20))
    stir: float = key(
        "How much worn sensors stir the air: 1 turns it about the body's anchor as fast as the hand turns.",
        0.0,
        within=(0, 4),
    )
    feedback: float = key(
        "How strongly the strings (`strings:`) pull back the bones that draw them: 0 not at all, 1 as firmly "
        "as a spring at which the free mass swings 2.5 times a second.",
        0.0,
        within=(0, 1),
    )
    kick: Wind = key(
        "Velocity that every mass gets when the setting is called up (x, y, z), metres a second.",
        (0.0, 0.0, 0.0),
    )

    def region(self, name: Region) -> RegionConfig:
        region: RegionConfig = getattr(self, name)
        return region


def _region(directional: float, damping: float, mass: float = 1.0) -> RegionConfig:
    return RegionConfig(mass=mass, directional_stiffness=directional, damping=damping)


def built_in() -> list[SpringsConfig]:
    """Loose: swings after each movement, and hangs; stiff: overshoots a little; storm: blown about."""
    return [
        SpringsConfig(
            name="loose",
            trunk=_region(300.0, 1.5, 2.0),
            head=_region(18.0, 1.5),
            arms=_region(12.0, 1.5, 0.8),
            legs=_region(24.0, 1.5, 1.5),
            gravity=1.5,
            stir=0.5,
        ),
        SpringsConfig(
            name="stiff",
            trunk=_region(1200.0, 6.0, 2.0),
            head=_region(375.0, 6.0),
            arms=_region(250.0, 6.0, 0.8),
            legs=_region(500.0, 6.0, 1.5),
        ),
        SpringsConfig(
            name="storm",
            trunk=_region(200.0, 1.0, 2.0),
            head=_region(22.5, 1.0),
            arms=_region(15.0, 1.0, 0.8),
            legs=_region(30.0, 1.0, 1.5),
            wind=(9.0, 1.0, 4.0),
            gusts=1.0,
            air=2.0,
            stir=1.0,
        ),
    ]


def springs_by_name(settings: Sequence[SpringsConfig]) -> dict[str, SpringsConfig]:
    """The settings in their order, by name; without any the built-in ones."""
    return {setting.name: setting for setting in settings or built_in()}
