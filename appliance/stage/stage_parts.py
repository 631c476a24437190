"""The parts of a stage: every part that a tick joins, made from a show bundle and a box file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from appliance.box.clock import TICK_S
from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.box.realtime import borrowed_priority
from appliance.dancer.blending import Blending
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.grounding import Floor, Grounding, GroundingError
from appliance.dancer.hands import Hands
from appliance.dancer.live import Live
from appliance.dancer.loop import Loop
from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.motion_network import MotionNetworkError
from appliance.dancer.material.partner_network import PartnerNetwork
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import PhraseError
from appliance.dancer.phrase_cache import PhraseCache
from appliance.dancer.puppet import Puppet, PuppetNetwork
from appliance.dancer.puppeteers import WornSensor
from appliance.dancer.slerp import FloatArray
from appliance.dancer.springs import Springs
from appliance.levers.sources import LIVE, MAIN
from appliance.outputs.joint_frame import PuppetFrame
from appliance.outputs.outputs import Outputs
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.sensor.link import SensorLink, SensorReading
from appliance.sensor.neutral import Mounting
from appliance.sensor.state import restored_reading
from appliance.show.box import BoxConfig
from appliance.show.config_error import ConfigError
from appliance.show.puppets import PuppetStart
from appliance.show.show import Show
from appliance.stage.admission import MOST_ITERATIONS, Admission, admit, lowered
from appliance.stage.continuing import Continuing
from appliance.stage.iterations import Iterations
from appliance.stage.liveliness import Liveliness
from appliance.stage.open_sensors import open_sensors
from appliance.stage.personal_space import PersonalSpace
from appliance.stage.puppeteers_of_show import mounting_of, puppeteers_of
from appliance.stage.stage_error import StageError
from appliance.stage.stage_puppet import StagePosition, StagePuppet


@dataclass(slots=True)
class StageParts:
    """Everything that dances, hears and speaks.

    network: dances all puppets in one run. names: the puppets'. led: the one that cues and orders lead.
    `worn`: which joints a sensor holds, of any puppet; `mountings`: how it is worn for each of these;
    `complaints`: why sensors are not let in.
    """

    SNAPSHOT = ("puppets", "liveliness", "newest_primary", "continuing", "space")

    skeleton: Skeleton
    network: PuppetNetwork
    puppets: tuple[StagePuppet, ...]
    names: tuple[str, ...]
    led: StagePuppet
    liveliness: Liveliness
    worn: dict[str, list[WornSensor]]
    mountings: dict[str, list[Mounting]]
    primary: str | None
    link: SensorLink
    outputs: Outputs
    live_figure: Figure | None = None  # the live dancer's; None: the show has no live dancer
    live_inbox: LivePoseReader | None = None
    live_refused: int = 0  # poses of another figure, or none
    complaints: tuple[str, ...] = ()
    newest_primary: SensorReading | None = field(default=None)
    continuing: Continuing | None = None
    space: PersonalSpace | None = None  # None: one puppet, or none that gives way

    @property
    def not_let_in(self) -> list[str]:
        """Sensors of the show that have no key here."""
        return [name for name in self.worn if not self.link.lets_in(name)]

    @property
    def are_due(self) -> bool:
        """Whether the network is to dance in this tick: they share their hop, so all of them or none."""
        return any(one.blending.is_due for one in self.puppets)

    @property
    def springs(self) -> list[Springs]:
        """The springs of all puppets that have some among their hands."""
        return [one.springs for one in self.puppets if one.springs is not None]

    @property
    def has_live(self) -> bool:
        """Whether the show has a live dancer: then each puppet may dance after it."""
        return self.live_figure is not None

    @property
    def rate(self) -> float:
        """The pace of playback, one for all puppets."""
        return self.puppets[0].motion.rate

    @property
    def phrases(self) -> tuple[str, ...]:
        """Names of the show's phrases, which each puppet may play."""
        return self.puppets[0].motion.phrases

    def run_with(self, measured: Admission) -> None:
        """Let each puppet run with as many of its iterations as fit."""
        for one in self.puppets:
            wished = one.iterations.wished
            times = lowered(*wished, measured.coding)
            one.iterations = Iterations(*times, measured.most_coding, wished)

    def hear(self, reading: SensorReading) -> None:
        """Give a reading to the joints that its sensor holds."""
        for puppeteer in self.worn.get(reading.sensor, ()):
            puppeteer.take_reading(reading.orientation, reading.arrival, reading.measured_at)
        if reading.sensor == self.primary:
            self.newest_primary = reading

    def hear_live(self) -> LivePose | None:
        """The pose of a live dancer that has come since the last tick, once it is believed."""
        heard = self.live_inbox.read() if self.live_inbox is not None and self.has_live else None
        if heard is None:
            return None
        pose = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)
        root = np.array(heard.root, np.float32)
        if heard.joints == len(self.skeleton) and all(
            one.live.hear(pose, root, heard.arrival, one.motion.window()[0])
            for one in self.puppets
            if one.live is not None
        ):
            return heard
        self.live_refused += 1
        return None

    def point_hands(self, out: FloatArray) -> None:
        """Write where the hands of all puppets point their joints, (H, 4); zeros: none of one joint."""
        row = 0
        for puppet in self.puppets:
            for hand, by_place in zip(puppet.hands.puppeteers, puppet.hands.by_place, strict=True):
                if not by_place and not isinstance(hand, Springs):
                    out[row] = hand.orientation
                row += 1

    def show_live(self, now: float, out: FloatArray) -> None:
        """Write where a live dancer's joints are, (J, 3) metres; zeros: nobody is there."""
        if self.live_figure is None or (live := self.puppets[0].live) is None:
            return
        if (seen := live.look(now)) is None:
            out[:] = 0.0
            return
        self.live_figure.set_pose(*seen)
        out[:] = self.live_figure.positions

    def make_by(self, make: Callable[[str], Loop]) -> None:
        """Where loops of recipes come from; it raises ValueError."""
        for one in self.puppets:
            one.motion.make_by(make)

    def settle(self) -> None:
        """A restored reading is one again."""
        self.newest_primary = restored_reading(self.newest_primary)

    def close(self) -> None:
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
    network_of: Callable[[Path, Skeleton, int], PuppetNetwork] = PuppetNetwork,
) -> StageParts:
    """Open every port and file of a show; `profiles`: the sensors' calibrations that the box has kept;
    `memory`: a folder where phrases that were made ready are kept for the next start; `network_of`: another
    network in place of the show's own, from its file, the skeleton and the number of puppets.

    Raises a CorrectableError before anything dances. Keys that are missing are no reason not to dance:
    see `complaints`.
    """
    config, cast = show.config, show.config.cast
    network = network_of(show.network, show.skeleton, len(cast))
    show.require_moving(network.joints)
    motion, floor = _playback(show, network.window, PhraseCache(show.directory, memory))
    puppets = [
        _stage_puppet(show, start, puppet, _motion_of(start, motion), floor)
        for start, puppet in zip(cast, network.puppets, strict=True)
    ]
    worn: dict[str, list[WornSensor]] = {}
    mountings: dict[str, list[Mounting]] = {}
    for start, made in zip(cast, puppets, strict=True):
        for hand, puppeteer in zip(start.hands, made.hands.puppeteers, strict=True):
            if hand.sensor is not None and isinstance(puppeteer, WornSensor):
                worn.setdefault(hand.sensor, []).append(puppeteer)
                mountings.setdefault(hand.sensor, []).append(mounting_of(hand))
    link, complaints = open_sensors(box, list(worn), profiles, memory.parent if memory else None)
    return StageParts(
        skeleton=show.skeleton,
        network=network,
        puppets=tuple(puppets),
        names=tuple(puppet.name for puppet in cast),
        led=next(one for start, one in zip(cast, puppets, strict=True) if start.is_led),
        liveliness=Liveliness(config.dancer.liveliness, config.dancer.seed, puppets),
        worn=worn,
        mountings=mountings,
        primary=config.primary_sensor,
        link=link,
        outputs=_outputs(show, box, box_file),
        complaints=complaints,
        continuing=_continuing(show, puppets),
        live_figure=Figure(show.skeleton) if config.motion.live else None,
        space=_space(show, puppets),
    )


def measure_admission(parts: StageParts, box: BoxConfig) -> Admission:
    """Measure the show's iterations on this machine with the first window and all hands of all puppets.

    Raises StageError where the network fails.
    """
    dance, asked = _dance(parts), max(one.iterations.wished for one in parts.puppets)
    with borrowed_priority(box.realtime.priority if box.realtime.enabled else None):
        return replace(admit(dance, *asked, box.limits.tick_budget_ms), puppets=len(parts.puppets))


def warm_up(parts: StageParts, admitted: Admission) -> None:
    """Let the network run once as the first tick will: its first run takes several times as long."""
    _dance(parts)(admitted.coding, admitted.interaction)


def _dance(parts: StageParts) -> Callable[[int, int], object]:
    """Runs all puppets with their first windows and all hands; their poses go nowhere. None of them runs
    with more iterations than the show gives it, but where there is one puppet.
    """
    held = []
    for one in parts.puppets:
        mask = one.hands.mask.copy()
        for place, is_by_place in zip(one.hand_places, one.hands.by_place, strict=True):
            (one.puppet.place_weights if is_by_place else mask)[place] = 1
        one.puppet.select(one.motion.window())
        held.append((one.puppet, one.iterations.wished, (mask, one.hands.targets, one.hands.weights)))

    def dance(coding: int, interaction: int) -> object:
        try:
            for puppet, most, joints in held:
                times = (coding, interaction) if len(held) == 1 else lowered(*most, coding)
                puppet.hold(*joints, *times)
            parts.network.dance()
        except Exception as error:  # onnxruntime has a separate class for every kind of failure
            raise StageError(
                f"{parts.network.path}: the network fails at {coding} coding iterations "
                f"({str(error)[:200]}). Nothing is danced. Export the show again."
            ) from None
        return None

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


def _continuing(show: Show, puppets: Sequence[StagePuppet]) -> Continuing | None:
    """The parts that go on by themselves; None for a show without any. Raises StageError."""
    config, answerer = show.config, show.config.answerer
    goes_on = config.motion.goes_on
    if goes_on is None and answerer is None:
        return None
    try:
        network = ImproviserNetwork(show.improviser, show.skeleton.names)
        partner = None if answerer is None else PartnerNetwork(show.partner, show.skeleton.names)
        if partner is not None and partner.features != network.features:
            raise MotionNetworkError("The partner was trained with another improviser.")
    except (MotionNetworkError, OSError) as error:
        raise StageError(
            f"{show.directory}: no puppet can go on by itself: {error} Nothing is danced. Copy the bundle "
            "again, or remove `goes_on` and `partner` from show.yaml."
        ) from None
    after_s = None if goes_on is None else goes_on.after_s
    chosen = (goes_on.temperature, goes_on.top_p) if goes_on else ()
    return Continuing(network, partner, puppets, config.led.number, answerer, after_s, *chosen)


def _space(show: Show, puppets: Sequence[StagePuppet]) -> PersonalSpace | None:
    spaces = [one.space for one in show.config.puppets]
    return PersonalSpace(puppets, spaces) if len(list(filter(None, spaces))) > 1 else None


def _outputs(show: Show, box: BoxConfig, box_file: Path | None) -> Outputs:
    problems = box.output_misfits(show.skeleton.names, len(show.config.cast))
    if problems:
        raise ConfigError(problems)
    cast = show.config.cast
    hands = [[hand.joint if hand.points_a_joint else "" for hand in one.hands] for one in cast]
    names = [one.name for one in cast]
    return Outputs(box.outputs, show.skeleton, names, hands, show.config.motion.live)


def _motion_of(start: PuppetStart, motion: Playback) -> Playback:
    """A puppet's own playback of the show's phrases."""
    if start.is_led:
        return motion
    return motion.another(start.source if start.source in motion.phrases else MAIN, start.start_s)


def _stage_puppet(
    show: Show, start: PuppetStart, puppet: Puppet, motion: Playback, floor: Floor | None
) -> StagePuppet:
    config, grounding = show.config, Grounding(show.skeleton, floor)
    puppeteers = puppeteers_of(show, start.hands, puppet, grounding, motion)
    joints, window, times = puppet.joints, puppet.network.window, start.iterations
    blending = Blending(len(joints), window, config.dancer.hop, config.dancer.blending)
    place = None if start.position is None else StagePosition(start.position, motion.roots()[0])
    made = StagePuppet(
        puppet=puppet,
        motion=motion,
        blending=blending,
        grounding=grounding,
        hands=Hands(
            puppeteers, joints, window, None if place is None else place.placement, TICK_S * blending.ahead
        ),
        hand_places=[joints.index(hand.joint) for hand in start.hands],
        iterations=Iterations(*times, MOST_ITERATIONS, times),
        frame=PuppetFrame.of(len(show.skeleton)),
        crossfade_s=config.motion.crossfade_s,
        live=Live(len(show.skeleton), window) if config.motion.live else None,
        feet=show.skeleton.feet,
        springs=next((one for one in puppeteers if isinstance(one, Springs)), None),
        place=place,
    )
    if start.source == LIVE and not start.is_led:
        made.play(LIVE, 0.0)
    return made
