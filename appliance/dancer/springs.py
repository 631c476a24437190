"""Springs as a puppeteer: the body below a joint swings as a mass-spring system about the dancer's pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.glide import TICK_S, Glide
from appliance.dancer.mass_spring import FASTEST_M_S, SUBSTEP_S, MassSpring, Vectors
from appliance.dancer.puppeteers import Puppeteer, WornSensor
from appliance.dancer.slerp import FloatArray
from appliance.dancer.slow_strings import SlowStrings
from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.skeleton import Skeleton
from appliance.show.sound import StringsConfig
from appliance.show.springs import Region, SpringsConfig

REGIONS: tuple[Region, ...] = get_args(Region)
STORM = np.array([9.0, 1.0, 4.0])  # m/s at full strength
STORM_AIR = 2.0  # 1/s
_PARTS = {
    "regions": slice(0, 16),  # mass, stiffness, directional stiffness, damping of each
    "air_and_hand": slice(16, 20),  # follow, gusts, air, stir
    "wind": slice(20, 23),
    "gravity": slice(23, 24),
    "feedback": slice(24, 25),
    "stiffness": slice(25, 26),  # a factor
    "storm": slice(26, 27),
    "gate": slice(27, 28),  # whether feedback may act
}

JUMP_M = 0.25  # an anchor that moves further in a tick has jumped: the masses are carried along
FARTHEST = 2.0  # times the body's reach that a mass may be from the anchor, along each axis
_FASTEST_PHRASE_M_S = 10.0
_BRANCHING = 0.3  # fraction of the longest bone: children whose mean is nearer than that turn nothing
_SUM = np.ones((3, 1))
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_SMALLEST = 1e-6


class Springs(Puppeteer):
    """Holds its joint and those below it that the network moves, as far as no other hand holds them.

    There is a mass at each of these joints, anchored at the first. Springs hold the bones' lengths and draw
    each bone to a direction between the phrase's and that of the puppet's last pose; targets turn the
    phrase's bones to where the masses are: so the springs follow the dancer, and the dancer the springs.
    Swinging is damped towards the phrase's motion. Damped towards the puppet's, the two drove each other
    to 5 m/s. Held joints are those with a bone below them; joints at the ends are only masses.

    regions: of each mass, and of the bone that leads to it. joints: those that are held; orientations
    (len(joints), 4): local, written by each pull. setting: the name in force; what `turn` turns stays until
    another setting is called up. With feedback, strings that the bones draw pull them back.
    """

    SNAPSHOT = ("setting", "_is", "_strings", "_body", "_before", "_turned", "_pulls", "_begun")

    def __init__(
        self,
        joint: str,
        skeleton: Skeleton,
        figure: Figure,
        moving: Sequence[str],
        settings: Mapping[str, SpringsConfig],
        setting: str,
        weight: float = 1.0,
        others: Sequence[Puppeteer] = (),
        strings: StringsConfig | None = None,
    ) -> None:
        """figure: has the puppet's last pose at each pull; moving: joints that the network moves; others: the
        show's other hands; strings: the show's.

        Raises ValueError where nothing hangs below the joint."""
        super().__init__(joint, weight)
        self.settings, self._puppet, self._phrase = settings, figure, Figure(skeleton)
        below = skeleton.descendants(skeleton.index(joint))
        nodes = [place for place in sorted(below) if skeleton.names[place] in moving]
        parents = [_nearest(skeleton, place, nodes) for place in nodes]
        self._nodes: NDArray[np.intp] = np.array(nodes)
        self.regions = tuple(_regions(skeleton, nodes, parents))
        self._is = SpringsParameters(self.regions)
        self._body = MassSpring(parents)
        self._strings = SlowStrings(skeleton, nodes, strings or StringsConfig(), SUBSTEP_S)
        self._bones_of = np.eye(len(nodes)) - np.eye(len(nodes))[np.maximum(parents, 0)]

        taken = [other.joint for other in others]
        held = [n for n in range(len(nodes)) if n in parents and skeleton.names[nodes[n]] not in taken]
        if not held or held[0] != 0:
            raise ValueError(
                f"No springs can hang from '{joint}': the network moves no joint below it. Name a joint "
                "further up, like the first one of the spine."
            )
        self.joints = tuple(skeleton.names[nodes[node]] for node in held)
        self.orientations = np.tile(quaternion.IDENTITY, (len(held), 1))
        self._held = self._nodes[held]
        self._above = np.maximum([skeleton.parents[place] for place in self._held], 0)
        self._has_above = np.array([[skeleton.parents[place] >= 0] for place in self._held])
        # Place of the arc that turns each held joint's parent; the last one is no turn at all.
        self._arc_above = np.array([_nearest(skeleton, place, self._held.tolist()) for place in self._held])
        self._points_to = np.array([_points_to(skeleton, nodes, parents, node) for node in held])

        self._worn = [other for other in others if isinstance(other, WornSensor)]
        self._turned = np.tile(quaternion.IDENTITY, (len(self._worn), 1))
        self._before, self._flow = np.zeros((2, len(nodes), 3))
        self._most = FARTHEST * float(np.sum(np.linalg.norm(skeleton.offsets[nodes], axis=1)) + 0.1)
        self._pose: FloatArray = np.tile(quaternion.IDENTITY, (len(skeleton), 1))
        self._root: FloatArray = np.zeros(3, np.float32)
        self._pulls, self._begun = 0, False
        self.call(setting, kicks=False)

    @property
    def wind(self) -> Vectors:
        """(3,) m/s, without the storm."""
        return self._is.wind

    @property
    def gravity(self) -> float:
        """Downwards, m/s^2."""
        return self._is.gravity

    @property
    def feedback(self) -> float:
        """0..1: how strongly strings pull their bones back now."""
        return self._is.feedback

    def call(self, name: str, seconds: float = 0.0, kicks: bool = True) -> None:
        """Go over to a setting in these seconds. Raises KeyError for one that there is not."""
        self.setting = name
        self._is.call(self.settings[name], seconds)
        self.settle()
        if kicks:
            self.kick(self.settings[name].kick)

    def turn(self, knob: str, values: Sequence[float], seconds: float = 0.0) -> None:
        """knob: wind (x, y, z m/s), gravity (m/s^2), stiffness (a factor), feedback, storm or gate (0..1)."""
        self._is.turn(knob, values, seconds)
        self.settle()

    def kick(self, velocity: Sequence[float]) -> None:
        """Add a velocity (x, y, z), metres a second, to every mass."""
        self._body.velocities += np.clip(velocity, -FASTEST_M_S, FASTEST_M_S)

    def follow_phrase(self, pose: FloatArray, root: FloatArray) -> None:
        """Take the phrase's pose (J, 4) of this tick and its root (3,), metres."""
        self._pose, self._root = pose, root

    def energy(self) -> float:
        """Joules in motion, springs and strings."""
        return self._body.energy() + self._strings.energy()

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        if not (self.enabled or self.is_holding):
            self._begun = False  # at rest, and at no cost, until it is to hold again
            return
        if self._is.step():
            self.settle()
        self._phrase.set_pose(self._pose, self._root)
        stands = self._phrase.positions[self._nodes].astype(np.float64)
        body = self._body
        if not self._begun or not np.isfinite(body.positions).all():
            self._begun = True
            body.begin(stands)
            self._strings.still()
            self._before[:] = stands
        jumped = stands[0] - self._before[0]
        if float(jumped @ jumped) > JUMP_M * JUMP_M:
            body.positions += jumped
            self._before += jumped
        self._rest(stands)
        strings = self._strings if self._is.feedback > 0.0 else None
        body.step(stands[0], self._surroundings(stands), np.array((0.0, -self.gravity, 0.0)), strings)
        np.maximum(body.positions, stands[0] - self._most, out=body.positions)
        np.minimum(body.positions, stands[0] + self._most, out=body.positions)
        self._before[:] = stands
        self._pulls += 1
        self._turn(stands)
        orientation[:] = self.orientations[0]

    def _rest(self, stands: Vectors) -> None:
        """Write where bones are drawn to: in length the phrase's, in direction between it and the puppet."""
        follow, rest = self._is.follow, self._body.rest
        np.matmul(self._bones_of, stands, out=rest)
        lengths = np.sqrt((rest * rest) @ _SUM)
        rest += follow * (self._bones_of @ (self._puppet.positions[self._nodes] - stands))
        rest *= lengths / np.maximum(np.sqrt((rest * rest) @ _SUM), _SMALLEST)

    def settle(self) -> None:
        """Give masses and strings the numbers of this moment."""
        is_now = self._is
        self._damping = is_now.damping[:, None]
        self._drag = self._damping + is_now.air
        self._body.set_parameters(is_now.mass, is_now.stiffness, is_now.directional, self._drag[:, 0])
        self._strings.tune(is_now.feedback, self._body.mass, self._body.carried / 4)
        if is_now.feedback <= 0.0:
            self._strings.still()

    def _surroundings(self, stands: Vectors) -> Vectors:
        """Velocity (N, 3) towards which each mass is damped: of the phrase's motion, and of the air."""
        np.subtract(stands, self._before, out=self._flow)
        np.multiply(self._flow, 1.0 / TICK_S, out=self._flow)
        np.maximum(self._flow, -_FASTEST_PHRASE_M_S, out=self._flow)
        np.minimum(self._flow, _FASTEST_PHRASE_M_S, out=self._flow)
        np.multiply(self._flow, self._damping, out=self._flow)
        air: Vectors = self._is.air * (self._is.blow * _gust(self._pulls * TICK_S, self._is.gusts))
        self._flow += air
        stirred = self._stirred()
        if self._is.stir:
            self._flow += self._is.air * _cross(stirred[None], self._body.positions - stands[0])
        self._flow /= np.maximum(self._drag, _SMALLEST)
        return self._flow

    def _stirred(self) -> Vectors:
        """Angular velocity (3,) of the air, radians a second: that of the worn sensors' joints together."""
        total = np.zeros(3)
        for place, worn in enumerate(self._worn):
            if worn.is_holding:
                turn = quaternion.multiply(worn.orientation, quaternion.inverse(self._turned[place]))
                total += 2.0 * float(np.copysign(1.0, turn[0])) / TICK_S * turn[1:]
            self._turned[place] = worn.orientation
        return np.clip(self._is.stir * total, -20.0, 20.0)

    def _turn(self, stands: Vectors) -> None:
        """Write the orientations that turn the phrase's bones to where the masses are.

        The shortest arc a of a joint turns its world rotation W; local to its parent, which the arc b
        turns, that is W_parent^-1 b^-1 a W. Beyond a right angle an arc is less again, down to none at the
        opposite: there it would change sides in one tick.
        """
        there, here = self._points_to @ self._body.positions, self._points_to @ stands
        lengths = np.sqrt((there * there) @ _SUM * ((here * here) @ _SUM))
        arcs = np.zeros((len(there) + 1, 4))
        arcs[-1, 0] = 1.0
        arcs[:-1, :1] = np.maximum((there * here) @ _SUM, 0.0) + np.maximum(lengths, _SMALLEST)
        arcs[:-1, 1:] = _cross(here, there)
        arcs /= np.sqrt(np.einsum("hk,hk->h", arcs, arcs))[:, None]
        world = self._phrase.world
        above = np.where(self._has_above, world[self._above], quaternion.IDENTITY)
        above = quaternion.multiply(arcs[self._arc_above], above) * _CONJUGATE
        local = quaternion.multiply(above, quaternion.multiply(arcs[:-1], world[self._held]))
        local /= np.sqrt(np.einsum("hk,hk->h", local, local))[:, None]
        self.orientations[:] = local


def _cross(a: Vectors, b: Vectors) -> Vectors:
    """numpy's own takes four times as long for few vectors."""
    product: Vectors = a[:, (1, 2, 0)] * b[:, (2, 0, 1)] - a[:, (2, 0, 1)] * b[:, (1, 2, 0)]
    return product


def _gust(seconds: float, share: float) -> float:
    """Strength of the wind, 0..2: three waves that never meet again."""
    waves = math.sin(1.1 * seconds) + 0.6 * math.sin(2.7 * seconds + 1.0) + 0.4 * math.sin(6.3 * seconds)
    return 1.0 + share * waves / 2.0


def _nearest(skeleton: Skeleton, place: int, among: Sequence[int]) -> int:
    """Where in `among` the nearest joint above `place` stands; -1: there is none."""
    above = skeleton.ancestors(place)[1:]
    return next((list(among).index(joint) for joint in above if joint in among), -1)


def _points_to(skeleton: Skeleton, nodes: Sequence[int], parents: Sequence[int], node: int) -> Vectors:
    """(N,): times the positions, where a joint's bones point: to the mean of the nodes below it; where these
    lie around it, to the one that most of the body hangs from."""
    rest = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
    positions, _ = skeleton.forward_kinematics(rest, np.zeros(3))
    children = [child for child, parent in enumerate(parents) if parent == node]
    bones = positions[[nodes[child] for child in children]] - positions[nodes[node]]
    if np.linalg.norm(bones.mean(axis=0)) < _BRANCHING * np.linalg.norm(bones, axis=1).max():
        children = [max(children, key=lambda child: len(skeleton.descendants(nodes[child])))]
    row = np.zeros(len(nodes))
    row[children] = 1.0 / len(children)
    row[node] = -1.0
    return row


def _regions(skeleton: Skeleton, nodes: Sequence[int], parents: Sequence[int]) -> list[tuple[Region, Region]]:
    """The region of each node's mass, and of the bone that leads to it: that of the joint that turns it."""
    anatomy = Anatomy(skeleton)
    found: dict[int, Region] = {}
    for start, first in anatomy.limbs():
        limb = [first, *anatomy.below(first)]
        has_foot = any(joint in skeleton.feet for joint in limb)
        is_leg = has_foot if skeleton.feet else start == anatomy.trunk[0]
        found |= dict.fromkeys(limb, "legs" if is_leg else "arms")
    for joint in anatomy.neck:
        found |= dict.fromkeys([joint, *anatomy.below(joint)], "head")
    regions = [found.get(place, "trunk") for place in nodes]
    return [(region, regions[max(parent, 0)]) for region, parent in zip(regions, parents, strict=True)]


class SpringsParameters:
    """mass, stiffness, directional, damping (N,) of each node; the rest are of all.

    wind (3,), gravity: as they were set; blow (3,): the wind with the storm.
    """

    SNAPSHOT = ("_glide",)

    def __init__(self, regions: Sequence[tuple[Region, Region]]) -> None:
        """regions: of each node's mass, and of the bone that leads to it."""
        self._own = np.array([REGIONS.index(own) for own, _ in regions])
        self._turning = np.array([REGIONS.index(turning) for _, turning in regions])
        self._glide = Glide(28, roots=16)
        self.mass, self.stiffness, self.directional, self.damping = np.zeros((4, len(self._own)))
        self.blow = np.zeros(3)
        self.follow, self.stir, self.gusts, self.air, self.feedback = np.zeros(5).tolist()
        self.turn("gate", (1.0,), 0.0)

    @property
    def wind(self) -> NDArray[np.float64]:
        """(3,) m/s, without the storm."""
        return self._glide.values[_PARTS["wind"]]

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return float(self._glide.values[_PARTS["gravity"]][0])

    def call(self, setting: SpringsConfig, seconds: float) -> None:
        """Go over to a setting; the knobs return to where they turn nothing."""
        regions = [setting.region(name) for name in REGIONS]
        numbers = [(one.mass, one.stiffness, one.directional_stiffness, one.damping) for one in regions]
        values: dict[str, Any] = {
            "regions": np.ravel(numbers),
            "air_and_hand": (setting.follow, setting.gusts, setting.air, setting.stir),
            "wind": setting.wind,
            "gravity": setting.gravity,
            "feedback": setting.feedback,
            "stiffness": 1.0,
            "storm": 0.0,
        }
        for name, numbers_of in values.items():
            self._glide.aim(_PARTS[name], numbers_of, seconds)
        self.settle()

    def turn(self, knob: str, values: Sequence[float], seconds: float) -> None:
        """Fade one knob to these values over `seconds`."""
        self._glide.aim(_PARTS[knob], values, seconds)
        self.settle()

    def step(self) -> bool:
        """One tick; whether anything has changed."""
        changed = self._glide.step()
        if changed:
            self.settle()
        return changed

    def settle(self) -> None:
        """Work out what follows from the values."""
        values = self._glide.values
        regions = values[_PARTS["regions"]].reshape(len(REGIONS), 4)
        self.follow, gusts, air, self.stir = values[_PARTS["air_and_hand"]].tolist()
        feedback, factor, storm, gate = values[24:].tolist()
        self.mass, self.damping = regions[self._own, 0], regions[self._own, 3]
        self.stiffness = regions[self._turning, 1]
        self.directional = regions[self._turning, 2] * factor
        self.gusts, self.air = max(gusts, storm), max(air, storm * STORM_AIR)
        self.blow = self.wind + storm * STORM
        self.feedback = feedback * gate
