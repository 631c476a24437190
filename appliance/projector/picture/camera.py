"""The camera: slow moves as a function of time, that go along with the dancer and never lose a hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from appliance.outputs.coupling import ROWS
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array
from appliance.projector.picture.poses import Poses
from appliance.show.look import CameraConfig

UPRIGHT = 1.35  # a figure may stand taller than an upright picture is wide: it is slender
AIM = 0.5  # height that the camera looks at, in figure heights
ROOM = 0.82  # fraction of the half picture that joints may use; the rest is for the flesh around them
KNEE = 8  # how suddenly the camera draws back when a joint comes near the edge: higher is later
NEAR, FAR = 0.2, 30.0  # figure heights; for a camera that stands no farther off than half of it

Changes = Mapping[str, float | str]

_AGES = (np.arange(ROWS) + 0.5) / ROWS
_SMOOTH = np.sin(np.pi * _AGES) ** 2 / np.sum(np.sin(np.pi * _AGES) ** 2)  # 0.6 s behind, without a jolt
_RECENT = np.cos(0.5 * np.pi * np.arange(ROWS) / ROWS) ** 2


@dataclass(frozen=True)
class View:
    """Where the camera stands, in figure heights; right, up and back are its axes; slopes: half the picture's
    width and height at distance 1; ground (2,): x and z of where the dancer has lately been."""

    eye: Array
    right: Array
    up: Array
    back: Array
    slopes: tuple[float, float]
    ground: Array
    azimuth: float

    @cached_property
    def projection(self) -> Array:
        """(4, 4) from figure heights to clip space, for column vectors."""
        axes = np.stack([self.right, self.up, self.back])
        look = np.eye(4)
        look[:3, :3], look[:3, 3] = axes, -axes @ self.eye
        lens = np.zeros((4, 4))
        lens[0, 0], lens[1, 1] = 1 / self.slopes[0], 1 / self.slopes[1]
        away = float((self.eye - [self.ground[0], AIM, self.ground[1]]) @ self.back)
        near, far = (limit * max(1.0, 2.0 * away / FAR) for limit in (NEAR, FAR))
        lens[2, 2], lens[2, 3] = (far + near) / (near - far), 2 * far * near / (near - far)
        lens[3, 2] = -1.0
        return np.asarray(lens @ look)

    def on_picture(self, place: Array) -> tuple[float, float]:
        """Where a place appears, in picture heights from the lower left corner."""
        x, y, _, w = self.projection @ np.append(place, 1.0)
        return float((0.5 + 0.5 * x / w) * self.slopes[0] / self.slopes[1]), float(0.5 + 0.5 * y / w)

    def over(self, place: Array, beyond: float) -> Array:
        """The place straight above this one, `beyond` figure heights outside the picture's upper edge."""
        up, away = (place - self.eye) @ self.up, (self.eye - place) @ self.back
        return np.asarray(place + (away * self.slopes[1] - up + beyond) * self.up)


class _Stand(NamedTuple):
    """A CameraConfig's values at one time."""

    azimuth: float
    elevation: float
    lens: float
    figure: float
    follow: float


class CuedCamera(NamedTuple):
    """A cue's changes to the look's camera, by its keys: before, now, and 0..1 how far it is on its way."""

    before: Changes
    now: Changes
    mix: float


NOT_CUED = CuedCamera({}, {}, 1.0)


class Ways:
    """Which way round a camera goes from one angle to another: the short one at first, then on that way.

    Both ends may circle meanwhile; the other way round becoming the shorter one would be a jump.
    """

    def __init__(self) -> None:
        self._before: dict[str, tuple[float, float]] = {}

    def __call__(self, name: str, radians: float, share: float) -> float:
        """The way of a fade of that name that is `share` over, from what it was a picture ago; less of it
        over than then: another fade."""
        way, done = self._before.get(name, (0.0, 0.0))
        way = way if share >= done else 0.0
        way += (radians - way + np.pi) % (2 * np.pi) - np.pi
        self._before[name] = (way, share) if share < 1.0 else (0.0, 0.0)
        return way


def view(
    before: CameraConfig,
    now: CameraConfig,
    mix: float,
    time_s: float,
    poses: Poses,
    aspect: float,
    cued: CuedCamera = NOT_CUED,
    ways: Ways | None = None,
) -> View:
    """The camera at time_s; mix 0: as in `before`, 1: as in `now`; aspect: the picture's width / height;
    ways: the same object for every picture of a wall; None: for a single picture."""
    ways = ways or Ways()

    def between(name: str, a: _Stand, b: _Stand, share: float) -> _Stand:
        """From one stand to another."""
        mixed = [first + ease(share) * (second - first) for first, second in zip(a, b, strict=True)]
        return _Stand(a.azimuth + ease(share) * ways(name, b.azimuth - a.azimuth, share), *mixed[1:])

    left, reached = (
        between(name, _stand(before, time_s, changes), _stand(now, time_s, changes), mix)
        for name, changes in (("left", cued.before), ("reached", cued.now))
    )
    stand = between("cued", left, reached, cued.mix)
    slope = float(np.tan(stand.lens / 2))
    slopes = (slope * aspect, slope) if aspect >= 1 else (slope, slope / aspect)
    distance = 0.5 / (stand.figure * min(slopes[1], UPRIGHT * slopes[0]))
    across = np.array([np.cos(stand.azimuth), 0.0, -np.sin(stand.azimuth)])
    towards = np.array([np.sin(stand.azimuth), 0.0, np.cos(stand.azimuth)])
    centre = (_SMOOTH[:, None] * poses.roots).sum(axis=0) * [1.0, 0.0, 1.0]
    left_behind = (1 - stand.follow) * centre
    side, depth = float(left_behind @ across), float(left_behind @ towards)
    aim = centre - across * _limited(side, max(0.1, distance * slopes[0] - 0.55))
    aim = aim - towards * _limited(depth, 0.3 * distance) + [0.0, AIM, 0.0]
    back = towards * np.cos(stand.elevation) + np.array([0.0, np.sin(stand.elevation), 0.0])
    up = np.cross(back, across)
    seen = (poses.positions.astype(float) - aim) @ np.stack([across, up, back]).T
    distance = _drawn_back(seen, distance, slopes)
    return View(aim + distance * back, across, up, back, slopes, centre[[0, 2]], stand.azimuth)


def _stand(config: CameraConfig, time_s: float, changes: Changes) -> _Stand:
    if changes:
        config = config.model_copy(update=dict(changes))
    turn = 2 * np.pi * time_s / config.period_s
    azimuth, elevation = np.radians(config.angle_deg), np.radians(config.elevation_deg)
    if config.move == "orbit":
        azimuth += turn
    elif config.move == "drift":
        azimuth += np.radians(config.sweep_deg) * np.sin(turn)
        elevation += np.radians(0.12 * config.sweep_deg) * np.sin(0.618 * turn)
    return _Stand(float(azimuth), float(elevation), np.radians(config.lens_deg), config.figure, config.follow)


def _limited(value: float, limit: float) -> float:
    return limit * float(np.tanh(value / limit))


def _drawn_back(seen: Array, distance: float, slopes: tuple[float, float]) -> float:
    """The distance from which all joints are in the picture; seen: (ROWS, J, 3) from the aim to the right, up
    and towards the camera."""
    half = ROOM * np.array(slopes)
    needed = np.max(np.abs(seen[..., :2]) / half + seen[..., 2:], axis=(1, 2))
    return float((distance**KNEE + max(0.0, float(np.max(_RECENT * needed))) ** KNEE) ** (1.0 / KNEE))
