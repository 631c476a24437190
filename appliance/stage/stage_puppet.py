"""One puppet on the stage: what it starts from, its hands, its network, its body and where that stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from appliance.box.checkpoint import Standing
from appliance.dancer.blending import Blending
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.grounding import Grounding
from appliance.dancer.hands import Hands
from appliance.dancer.lead import Lead
from appliance.dancer.live import Live
from appliance.dancer.loop import Placement, turns_about_y
from appliance.dancer.material.material_file import Material
from appliance.dancer.motion_source import Playback
from appliance.dancer.puppet import Puppet, weights_of_one_pass
from appliance.dancer.slerp import FloatArray
from appliance.dancer.springs import Springs
from appliance.levers.sources import LIVE
from appliance.outputs.joint_frame import PuppetFrame
from appliance.pose import quaternion
from appliance.pose.possible import FARTHEST_ON_STAGE_M
from appliance.show.puppets import PuppetConfig
from appliance.stage.iterations import Iterations

_STANDING = ("pose", "world", "positions", "root")  # arrays of a frame


class StagePosition:
    """Where a puppet's dance stands on the stage: its first root at x, z (metres), turned about it."""

    def __init__(self, config: PuppetConfig, root: FloatArray) -> None:
        """root (3,): of the puppet's first pose, metres."""
        moved = Placement(math.radians(config.turned), config.x, config.z)
        moved = moved.after(Placement(0.0, -float(root[0]), -float(root[2])))
        self.placement = moved  # from the puppet's own floor to the stage
        x, z = moved.x, moved.z
        cosine, sine = math.cos(moved.yaw), math.sin(moved.yaw)
        self._turn = turns_about_y(np.array(moved.yaw)).astype(np.float32)
        self._columns = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]], np.float32)
        self._shift = np.array([x, 0.0, z], np.float32)

    def put(self, frame: PuppetFrame) -> None:
        """Move a frame from where the puppet danced it to its place."""
        frame.positions[:] = frame.positions @ self._columns + self._shift
        frame.root[:] = frame.root @ self._columns + self._shift
        frame.world[:] = quaternion.multiply(self._turn, frame.world)
        frame.pose[0] = quaternion.multiply(self._turn, frame.pose[0])
        frame.source[0] = quaternion.multiply(self._turn, frame.source[0])


@dataclass(slots=True)
class StagePuppet:
    """A figure, its parts, and what they make of a tick, in the order in which data flows: start, pull, (the
    network dances,) blend, stand.

    hand_places: where the hands' joints stand among the moving ones; place None: where its phrase has it;
    network_failed: the last good pose stays, because the network gave none. figures_refused: ticks whose
    figure no stage has: the last good frame stays, and what led there is forgotten. Further inputs of the
    network: liveliness, how much of the phrase's own stays while a hand holds (1: all of it), and noise (Z,),
    added to the latent.
    """

    SNAPSHOT = (
        *("motion", "blending", "grounding", "hands", "live", "iterations", "network_failed", "_danced"),
        *("lead", "frame"),
    )

    puppet: Puppet
    motion: Playback
    blending: Blending
    grounding: Grounding
    hands: Hands
    hand_places: list[int]
    iterations: Iterations
    frame: PuppetFrame
    crossfade_s: float
    live: Live | None = None  # None: the show has no such source
    feet: Sequence[int] = ()  # joints of the skeleton
    springs: Springs | None = None  # those among the hands
    place: StagePosition | None = None
    network_failed: bool = False
    figures_refused: int = 0
    liveliness: float = 1.0
    continued: float = 0.0
    lead: Lead = field(default_factory=Lead)
    noise: FloatArray = field(init=False)
    _whole: FloatArray = field(init=False)  # (T, J, 4)
    _roots: FloatArray = field(init=False)  # (T, 3)
    _window: FloatArray = field(init=False)  # (T, M, 4)
    _danced: NDArray[np.float32] = field(init=False)  # (J, 4), not yet grounded

    def __post_init__(self) -> None:
        self._whole, self._roots = self.motion.window(), self.motion.roots()
        self._window = self.puppet.select(self._whole)
        self._danced = self._whole[0].copy()
        self.noise = np.zeros(self.puppet.latent, np.float32)

    @property
    def begun_with(self) -> tuple[FloatArray, FloatArray]:
        """The window (T, J, 4) and the roots (T, 3) that it has started from in this tick."""
        return self._whole, self._roots

    def begin_with(self, window: FloatArray, roots: FloatArray, continued: float) -> None:
        """Start from others in this tick; continued: how much of them goes on by itself, 0..1."""
        if window is not self._whole:
            self._window = self.puppet.select(window)
        self._whole, self._roots, self.continued = window, roots, continued

    @property
    def lift(self) -> float:
        """How far the figure is to be above the floor, metres: in a jump of the phrase."""
        live = self.live.share_of(self.feet) if self.live is not None else 0.0
        return self.motion.lift * (1.0 - live) * (1.0 - self.continued)

    @property
    def source(self) -> str:
        """The name of what the puppet starts from: a phrase's, or `live`."""
        return LIVE if self.live is not None and self.live.is_chosen else self.motion.phrase

    def start(self, now: float) -> None:
        """Take the window and the roots of this tick; call it once a tick."""
        window, roots = self.motion.window(), self.motion.roots()
        if self.live is not None:
            window, roots = self.live.lay_over(now, window, roots)
        if self.springs is not None:
            self.springs.follow_phrase(window[0], roots[0])
        self._whole, self._roots = window, roots
        self._window = self.puppet.select(window)

    def pull(self, now: float) -> None:
        """Let the hands say where they hold their joints, and give all to the network."""
        hands, times, row = self.hands, self.iterations, self.puppet
        if hands.has_places:
            path = self.blending.shares @ self._roots + self.grounding.shift
            hands.pull(now, self._window, path, self.grounding.figure.positions)
            self.grounding.draw_hips(*hands.hips_drawn)
        else:
            hands.pull(now, self._window)
        row.hold(hands.mask, hands.targets, hands.weights, times.coding, times.interaction)
        row.places[:] = hands.places
        row.place_weights[:] = weights_of_one_pass(hands.place_weights, times.interaction)
        row.liveliness, row.noise[:] = self.liveliness, self.noise

    def blend(self) -> None:
        """Blend in what the network has danced, if it was due, and take the pose of this tick."""
        if self.blending.is_due:
            self.network_failed = self.puppet.is_broken
            if not self.network_failed:
                self.blending.add(self.puppet.poses)
        if not self.network_failed:
            self._danced[:] = self._whole[0]
            self.puppet.scatter(self.blending.take(), self._danced)

    def stand(self) -> None:
        """Put the danced pose on the floor and into the world."""
        frame, grounding = self.frame, self.grounding
        self.puppet.scatter(self.hands.holds, frame.holds)
        grounding.lead(*self.lead.step())
        try:
            figure = grounding.ground_pose(
                self._danced,
                self._roots[0],
                self.lift,
                self.motion.rest_heights,
                frame.holds,
            )
            is_possible = _is_possible(figure)
        except (ArithmeticError, ValueError):  # numbers beyond the range of a float
            is_possible = False
        if not is_possible:
            self.figures_refused += 1
            grounding.begin_anew()
            self.motion.return_home(FARTHEST_ON_STAGE_M / 2.0)
            if self.live is not None:
                self.live.stand_anew()
            return
        frame.source[:] = self._whole[0]
        frame.pose[:] = grounding.pose
        frame.world[:] = figure.world
        frame.positions[:] = figure.positions
        frame.root[:] = grounding.root
        if self.place is not None:
            self.place.put(frame)

    def lead_on_stage(self, x: float, z: float) -> None:
        """Ask the figure in this tick to be led over the stage's floor, metres a second."""
        if self.place is not None:
            x, z = Placement(-self.place.placement.yaw).point(x, z)
        self.lead.ask(x, z)

    def advance(self) -> None:
        """The frame has left: the motion moves on."""
        self.motion.advance()
        self.iterations.advance()

    def play(self, name: str, *fade_s: float) -> str:
        """Switch to a phrase, or to `live`; a sentence where nothing changes. Raises ValueError."""
        if name != LIVE or self.live is None:
            plays_already = not self.motion.play(name, *fade_s)
            if self.live is None or not self.live.is_chosen:
                return f"The phrase '{name}' plays already, and goes on." if plays_already else ""
        self.live.choose(name == LIVE, *(fade_s or (self.crossfade_s,)))
        return ""  # whether it is heard is reported separately

    def play_made(self, recipe: str, fade_s: float) -> None:
        """Go over to what the generator made. Raises ValueError, and the phrase plays on."""
        self.motion.enter(recipe, self.motion.made_by(recipe), fade_s)
        if self.live is not None and self.live.is_chosen:
            self.live.choose(False, fade_s)

    @property
    def noted(self) -> Standing:
        """Where a restarted stage lets this puppet go on."""
        phrase, position_s, made = self.motion.going_on
        let_go = [puppeteer.joint for puppeteer in self.hands.puppeteers if not puppeteer.enabled]
        return Standing(
            phrase,
            position_s,
            self.motion.excerpt_s,
            self.motion.standing,
            self.grounding.strayed,
            *self.iterations.asked,
            tuple(let_go),
            made,
        )

    def go_on(self, noted: Standing, rate: float, made: Material | None = None) -> str:
        """Before the first tick: continue where another stage's puppet was. made: what it danced, if that was
        made ahead and is still there. A sentence where fewer iterations fit. Raises ValueError.
        """
        self.motion.start_at(noted.phrase, noted.excerpt, noted.position_s, rate, noted.standing, made)
        self.grounding.strayed = noted.strayed
        for puppeteer in self.hands.puppeteers:
            puppeteer.enabled = puppeteer.joint not in noted.let_go
        return self.iterations.ask(noted.coding, noted.interaction)


def _is_possible(figure: Figure) -> bool:
    """Whether its numbers are some, and stand near the stage; two products and no array in a tick."""
    world, positions = figure.world.reshape(-1), figure.positions.reshape(-1)
    turned = math.isfinite(world.dot(world))
    return turned and bool(positions.dot(positions) <= len(positions) * FARTHEST_ON_STAGE_M**2)
