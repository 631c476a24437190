"""The parts of a stage: every part that a tick joins, made from a show bundle and a box file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.box.realtime import borrowed_priority
from appliance.dancer.blending import Blending
from appliance.dancer.grounding import Floor, Grounding, GroundingError
from appliance.dancer.hands import Hands
from appliance.dancer.live import Live
from appliance.dancer.loop import Loop
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import PhraseError
from appliance.dancer.phrase_cache import PhraseCache
from appliance.dancer.puppet import Puppet, PuppetError
from appliance.dancer.puppeteers import WornSensor
from appliance.dancer.slerp import FloatArray
from appliance.dancer.springs import Springs
from appliance.outputs.outputs import Outputs
from appliance.pose.bvh import BvhError
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.sensor.link import SensorLink, SensorReading
from appliance.sensor.neutral import Mounting
from appliance.sensor.state import restored_reading
from appliance.show.box import BoxConfig
from appliance.show.config_error import ConfigError
from appliance.show.show import Show
from appliance.show.sources import LIVE
from appliance.stage.admission import Admission, admit
from appliance.stage.open_sensors import open_sensors
from appliance.stage.puppeteers_of_show import mounting_of, puppeteers_of
from appliance.stage.stage_error import StageError


def _nothing_made(recipe: str) -> Loop:
    raise ValueError("Nothing was made ahead here.")


@dataclass(slots=True)
class StageParts:
    """Everything that dances, hears and speaks.

    `hand_places`: where the hands' joints stand among the moving ones; `worn`: which joints a sensor holds;
    `mountings`: how it is worn for each of these joints; `complaints`: why sensors are not let in.
    """

    skeleton: Skeleton
    puppet: Puppet
    motion: Playback
    blending: Blending
    grounding: Grounding
    hands: Hands
    hand_places: list[int]
    worn: dict[str, list[WornSensor]]
    mountings: dict[str, Mounting]
    primary: str | None
    link: SensorLink
    outputs: Outputs
    crossfade_s: float
    live: Live | None = None  # None: the show has no such source
    live_inbox: LivePoseReader | None = None
    live_refused: int = 0  # poses of another figure, or none
    springs: Springs | None = None  # those among the hands
    complaints: tuple[str, ...] = ()
    newest_primary: SensorReading | None = field(default=None)
    loop_of: Callable[[str], Loop] = field(default=_nothing_made)  # of a recipe

    def hear(self, reading: SensorReading) -> None:
        """Give a reading to the joints that its sensor holds."""
        for puppeteer in self.worn.get(reading.sensor, ()):
            puppeteer.take_reading(reading.orientation, reading.arrival)
        if reading.sensor == self.primary:
            self.newest_primary = reading

    def hear_live(self) -> LivePose | None:
        """The pose of a live dancer that has come since the last tick, once it is believed."""
        heard = None if self.live is None or self.live_inbox is None else self.live_inbox.read()
        if self.live is None or heard is None:
            return None
        pose, root = np.frombuffer(heard.rotations, np.float32), np.array(heard.root, np.float32)
        if heard.joints == len(self.skeleton) and self.live.hear(
            pose.reshape(-1, 4), root, heard.arrival, self.motion.window()[0]
        ):
            return heard
        self.live_refused += 1
        return None

    @property
    def lift(self) -> float:
        """How far the figure is to be above the floor, metres: in a jump of the phrase."""
        return self.motion.lift * (1.0 - (self.live.share if self.live is not None else 0.0))

    @property
    def source(self) -> str:
        """The name of what the puppet starts from: a phrase's, or `live`."""
        return LIVE if self.live is not None and self.live.is_chosen else self.motion.phrase

    def starts_from(self, now: float) -> tuple[FloatArray, FloatArray]:
        """The window (T, J, 4) and the roots (T, 3) of this tick; call it once a tick."""
        window, roots = self.motion.window(), self.motion.roots()
        if self.live is not None:
            window, roots = self.live.lay_over(now, window, roots)
        if self.springs is not None:
            self.springs.follow_phrase(window[0], roots[0])
        return window, roots

    def dance_made(self, recipe: str, fade_s: float) -> None:
        """Go over to what the generator made. Raises ValueError, and the phrase plays on."""
        try:
            self.motion.enter(recipe, self.loop_of(recipe), fade_s)
        except (LookupError, TypeError) as error:
            raise ValueError(f"What was made has no sound recipe ({error}); the phrase plays on.") from None
        if self.live is not None and self.live.is_chosen:
            self.live.choose(False, fade_s)

    def play(self, name: str, *fade_s: float) -> str:
        """Switch to a phrase, or to `live`; a sentence where nothing changes. Raises ValueError."""
        if name != LIVE or self.live is None:
            plays_already = not self.motion.play(name, *fade_s)
            if self.live is None or not self.live.is_chosen:
                return f"The phrase '{name}' plays already, and goes on." if plays_already else ""
        self.live.choose(name == LIVE, *(fade_s or (self.crossfade_s,)))
        return ""  # whether it is heard is news of its own

    def state(self) -> dict[str, Any]:
        """What the dance to come depends on, for `restore`: plain values and copies of arrays."""
        return {
            "motion": self.motion.state(),
            "blending": self.blending.state(),
            "grounding": self.grounding.state(),
            "hands": self.hands.state(),
            "live": None if self.live is None else self.live.state(),
            "newest_primary": self.newest_primary,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state that parts of the same show gave."""
        self.motion.restore(state["motion"])
        self.blending.restore(state["blending"])
        self.grounding.restore(state["grounding"])
        self.hands.restore(state["hands"])
        if self.live is not None:
            self.live.restore(state["live"])
        self.newest_primary = restored_reading(state["newest_primary"])

    def close(self) -> None:
        """Free ports and sockets."""
        self.link.close()
        self.outputs.close()
        if self.live_inbox is not None:
            self.live_inbox.close()


def assemble(
    show: Show,
    box: BoxConfig,
    profiles: Mapping[bytes, bytes] = MappingProxyType({}),
    box_file: Path | None = None,
    memory: Path | None = None,
) -> StageParts:
    """Open every port and file of a show; `profiles`: the sensors' calibrations that the box has kept;
    `memory`: a folder where phrases that were made ready are kept for the next start.

    Raises StageError or ConfigError before anything dances. Keys that are missing are no reason not to dance:
    see `complaints`.
    """
    try:
        puppet = Puppet(show.network, show.skeleton)
        show.require_moving(puppet.joints)
        motion, floor = _playback(show, puppet.window, PhraseCache(show.directory, memory))
    except PuppetError as error:
        raise StageError(str(error)) from error
    grounding = Grounding(show.skeleton, floor)
    puppeteers = puppeteers_of(show, puppet, grounding)
    worn: dict[str, list[WornSensor]] = {}
    mountings: dict[str, Mounting] = {}
    for hand, puppeteer in zip(show.config.hands, puppeteers, strict=True):
        if hand.sensor is not None and isinstance(puppeteer, WornSensor):
            worn.setdefault(hand.sensor, []).append(puppeteer)
            mountings[hand.joint] = mounting_of(hand)
    link, complaints = open_sensors(box, list(worn), profiles)
    return StageParts(
        skeleton=show.skeleton,
        puppet=puppet,
        motion=motion,
        blending=Blending(
            len(puppet.joints), puppet.window, show.config.dancer.hop, show.config.dancer.blending
        ),
        grounding=grounding,
        hands=Hands(puppeteers, puppet.joints, puppet.window),
        hand_places=[puppet.joints.index(hand.joint) for hand in show.config.hands],
        worn=worn,
        mountings=mountings,
        primary=show.config.primary_sensor,
        link=link,
        outputs=_outputs(show, box, box_file),
        live=Live(len(show.skeleton), puppet.window) if show.config.motion.live else None,
        crossfade_s=show.config.motion.crossfade_s,
        springs=next((one for one in puppeteers if isinstance(one, Springs)), None),
        complaints=complaints,
    )


def admission(parts: StageParts, show: Show, box: BoxConfig) -> Admission:
    """Measure the show's iterations on this machine with the first window and all hands of the show.

    Raises StageError where the network fails.
    """
    dance = _dance(parts, show.network)
    dancer = show.config.dancer
    with borrowed_priority(box.realtime.priority if box.realtime.enabled else None):
        return admit(
            dance, dancer.coding_iterations, dancer.interaction_iterations, box.limits.tick_budget_ms
        )


def warm_up(parts: StageParts, show: Show, admitted: Admission) -> None:
    """Let the network run once as the first tick will: its first run takes several times as long."""
    _dance(parts, show.network)(admitted.coding, admitted.interaction)


def _dance(parts: StageParts, network: Path) -> Callable[[int, int], object]:
    """Runs the puppet with the first window and all hands of the show; its poses go nowhere."""
    window = parts.puppet.select(parts.motion.window()).copy()
    mask, targets, weights = parts.hands.mask.copy(), parts.hands.targets, parts.hands.weights
    mask[parts.hand_places] = True

    def dance(coding: int, interaction: int) -> object:
        try:
            return parts.puppet.dance(window, mask, targets, weights, coding, interaction)
        except Exception as error:  # onnxruntime has a class of its own for every way to fail
            raise StageError(
                f"{network}: the network fails at {coding} coding iterations ({str(error)[:200]}). "
                "Nothing is danced. Export the show again."
            ) from None

    return dance


def _playback(show: Show, window: int, preparations: PhraseCache) -> tuple[Playback, Floor | None]:
    """All phrases of a show, ready to be switched, and the floor of the one that it starts with."""
    motion, (path, *others) = show.config.motion, show.phrases.values()
    try:
        phrase, floor = _phrase(show, path, preparations)
        playback = Playback(
            phrase,
            start_s=motion.start_s,
            end_s=motion.end_s,
            rate=motion.rate,
            crossfade_s=motion.crossfade_s,
            window=window,
            floor=floor,
        )
        for name, path in zip(motion.phrases, others, strict=True):
            playback.add(name, *_phrase(show, path, preparations))
    except BvhError as error:
        raise StageError(str(error)) from error
    except (PhraseError, GroundingError) as error:
        raise StageError(f"{path}: {error}") from error
    preparations.forget_others()
    return playback, floor


def _phrase(show: Show, path: Path, preparations: PhraseCache) -> tuple[Recording, Floor | None]:
    """A phrase at the tick's rate, and what its survey learnt of the floor."""
    found = preparations.phrase(path, show.skeleton, show.config.motion.grounded)
    if found is None:
        raise StageError(
            f"{path}: the phrase has other joints than {show.directory / 'skeleton.bvh'}. "
            "Nothing can be danced. Export the show again."
        )
    return found


def _outputs(show: Show, box: BoxConfig, box_file: Path | None) -> Outputs:
    problems = box.output_misfits(show.skeleton.names)
    if problems:
        raise ConfigError(problems)
    return Outputs(box.outputs, show.skeleton)
