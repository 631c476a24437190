"""The lights' process: shared frame and show state in, 40 times a second the levels of all universes out."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from appliance.box.fallback import Fallbacks
from appliance.box.orders import OrderInbox
from appliance.box.own_process import OwnProcess
from appliance.box.runtime_folder import runtime_folder
from appliance.box.show_state import ShowStateReader
from appliance.lights.fallback import DMX_AWAY, OF_THE_LIGHTS, STAGE_UNSEEN
from appliance.lights.live import LiveRig, OrderedWalk
from appliance.lights.patch import Patch
from appliance.lights.rig import LOST_S, Rig
from appliance.outputs.dmx.open_wire import open_universes
from appliance.outputs.dmx.pace import Universe
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.pair.part import PartReader
from appliance.pose.counted import counted
from appliance.show.asked_for import no_wires
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError, Problem
from appliance.show.lights import LightsConfig
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import at_venue, misplaced, unwired

_log = logging.getLogger(__name__)

_LOOK_S = 0.004  # while silent: how soon after the stage the lights take over

_REPORT_S = 1.0
_POLL_S = 0.1  # how often the stage is looked for
_GIVE_UP_S = 1.2  # at the end: a machine too busy to fade within this time jumps to its last levels


class Lights:
    """The rig of one show on the wires of one box. Raises ConfigError before it sends anything."""

    def __init__(
        self,
        show: Show,
        box: BoxConfig,
        stage: FrameReader,
        show_state: ShowStateReader,
        fallbacks: Fallbacks,
        inbox: OrderInbox | None = None,
        live: LiveRig | None = None,
    ) -> None:
        config = rig_here(show, box)
        patch = Patch(config.fixtures, show.directory)
        self.show, self.box = show, box
        cast, led = show.config.cast, show.config.led.name
        puppets = [puppet.name for puppet in cast]
        hands = [(puppet.name, hand.joint) for puppet in cast for hand in puppet.hands]
        self.rig = Rig(config, patch, show.skeleton, box.lights.rate_hz, puppets, led, hands)
        self.universes = wired(patch, box)
        self._walk, self._live = OrderedWalk(inbox, patch, box.lights.rate_hz), live
        self._stage, self._show_state, self._fallbacks = stage, show_state, fallbacks
        self._foreign: int | None = None
        self._was_lost = True
        self._speaking = Speaking(box, self.universes)
        self._troubles: dict[str, str] = {}
        self._remarks: set[str] = set()

    def log_setup(self) -> None:
        """Log which fixtures are lit by which wires, and what stays dark."""
        mappings = [mapping.name for mapping in self.show.config.lights.mappings]
        wires = " and ".join(universe.wire.name for universe in self.universes)
        rules = f"mappings {', '.join(mappings)}" if mappings else "no mapping: each lamp follows a limb"
        _log.info(f"Lights: {counted(len(self.rig.patch.fixtures), 'fixture')} by {wires}; {rules}.")
        for sentence in unwired(self.show.config, self.box):
            _log.warning(sentence)

    def run(self, stopped: Callable[[], bool], pulse: Callable[[float], None]) -> None:
        """Render and send on a grid of absolute deadlines until `stopped`; then fade to the safe look.

        `pulse` is called in each pass, with monotonic seconds.
        """
        period_s = 1.0 / self.box.lights.rate_hz
        deadline = time.monotonic()
        report_at = deadline + _REPORT_S
        while not stopped():
            now = self._next_pass()
            pulse(now)
            if now >= report_at:
                report_at = now + _REPORT_S
                self._report()
            deadline = self._speaking.wait(deadline, period_s) or _wait_for(deadline, period_s)
        self._walk.end()
        self.rig.fade_out()
        give_up = time.monotonic() + _GIVE_UP_S
        while self._next_pass() < give_up and self.rig.safety < 1.0:
            deadline = _wait_for(deadline, period_s)

    def close(self) -> None:
        """Send the safe look, or zeros, on all wires and close them."""
        levels, now = self.rig.last_levels(self._show_state.read()), time.monotonic()
        for universe in self.universes:
            if self._speaking.may_speak(now):
                universe.offer(levels[universe.number], now)
            universe.close(now)
        self._speaking.close()

    def _next_pass(self) -> float:
        now, show_state, patch = time.monotonic(), self._show_state.read(), self.rig.patch
        levels = self._walk.levels(show_state, now)
        if levels is None:
            levels = self.rig.render(self._frame(now), self._stage.generation, show_state, now)
        if self._live is not None:
            walked = self._walk.values
            self._live.publish(
                patch, self.rig.values if walked is None else walked, self._walk.description, now
            )
        if self._speaking.may_speak(now):
            for universe in self.universes:
                universe.offer(levels[universe.number], now)
        return now

    def _frame(self, now: float) -> JointFrame | None:
        """The newest frame, if it has the skeleton that these lights know."""
        frame, facts = self._stage.newest(now), self._stage.facts
        if frame is None or facts is None:
            return None
        if facts.skeleton.same_joints(self.show.skeleton):
            return frame
        if self._foreign != self._stage.generation:
            self._foreign = self._stage.generation
            _log.warning(
                f"The stage dances '{facts.show_name}' with another skeleton. The lights stay in their safe "
                f"look. Start them with --show {facts.show_directory}."
            )
        return None

    def _report(self) -> None:
        """Once a second: log what has changed on the stage and the wires."""
        lost = self.rig.is_lost
        if lost and not self._was_lost:
            self._fallbacks.set(STAGE_UNSEEN.name, True)
            _log.warning(
                f"No frame from the stage for {LOST_S:g} s. The lights fade to their safe look; they dance "
                "again as soon as the stage does. See what `bunraku play` says."
            )
        elif self._was_lost and not lost:
            self._fallbacks.set(STAGE_UNSEEN.name, False)
            _log.info("The stage dances, and the lights with it.")
        self._was_lost = lost
        for universe in self.universes:
            name, trouble = universe.wire.name, universe.wire.trouble or ""
            if trouble != self._troubles.get(name, ""):
                if trouble:
                    _log.warning(trouble)
                else:
                    _log.info(f"{name} is well again.")
            self._troubles[name] = trouble
            if (remark := universe.wire.remark) and remark not in self._remarks:
                self._remarks.add(remark)
                _log.warning(remark)
        self._fallbacks.parts = self._troubles
        self._fallbacks.concern(DMX_AWAY.name, [name for name, trouble in self._troubles.items() if trouble])
        self._fallbacks.set(DMX_AWAY.name, " ".join(filter(None, self._troubles.values())))


def rig_problems(show: Show, box: BoxConfig) -> list[Problem]:
    """Why a show's lights do not fit this venue."""
    problems = misplaced(show, box)
    if not show.config.lights.fixtures:
        cure = "Add them under lights: (see docs/lights.md)."
        problems.append(Problem(show.file.path, 0, "The show has no fixtures.", cure))
    return problems


def rig_here(show: Show, box: BoxConfig) -> LightsConfig:
    """A show's lights as they hang in this venue. Raises ConfigError when there is nothing to light."""
    if problems := rig_problems(show, box):
        raise ConfigError(problems)
    return at_venue(show.config.lights, box.lights)


def require_wires(box: BoxConfig) -> None:
    """Raise NotAskedForError for a box file without any wire to lights."""
    if not box.outputs.dmx:
        raise no_wires(box.path)


def wired(patch: Patch, box: BoxConfig) -> tuple[Universe, ...]:
    """The universes of this rig on open wires; universes without a fixture get none."""
    used = [config for config in box.outputs.dmx if config.universe in patch.universes]
    return open_universes(used, box.state_folder)


def run_lights(directory: Path | None, box_file: Path | None) -> None:
    """Light a show's rig until a signal comes; without a folder, the rig of the show that the stage dances.

    Raises ConfigError for a show or box file that cannot be lit, RuntimeFolderError without a place to meet.
    """
    box = load_box(box_file)
    require_wires(box)
    with OwnProcess(box, "lights", OF_THE_LIGHTS) as own:
        folder, stopped = own.folder, own.stopped
        stage, show_state = own.keep(FrameReader(folder)), own.keep(ShowStateReader(folder))
        live, inbox = own.keep(LiveRig(folder)), _open_inbox(folder)
        if inbox is not None:
            own.keep(inbox)
        parts = stage, show_state, own.fallbacks, inbox, live
        if directory is not None:
            lights = Lights(load_show(directory), box, *parts)
            own.notifier.ready("The lights dance.")
            _light(lights, stopped, own.pulse)
            return
        own.notifier.ready("The lights follow the stage.")
        active = ActiveShow(stage)
        while not stopped():
            if active.is_new(time.monotonic()):
                try:
                    lights = Lights(active.load(), box, *parts)
                except ConfigError as error:
                    _log.error(f"{error}\nThe lights stay off until the stage dances another show.")
                else:
                    _light(lights, lambda: stopped() or active.is_new(time.monotonic()), own.pulse)
            own.pulse(time.monotonic())
            time.sleep(_POLL_S)


def _open_inbox(folder: Path) -> OrderInbox | None:
    """For the walk through the rig; without it the dance is lit nonetheless."""
    try:
        return OrderInbox(folder, "lights")
    except OSError:
        return None


def _light(lights: Lights, stopped: Callable[[], bool], pulse: Callable[[float], None]) -> None:
    try:
        lights.log_setup()
        lights.run(stopped, pulse)
    finally:
        lights.close()


def _wait_for(deadline: float, period_s: float) -> float:
    """Sleep until the next deadline on the grid."""
    now = time.monotonic()
    deadline = _next_on_grid(deadline, period_s, now)
    time.sleep(max(deadline - now, 0.0))
    return deadline


def _next_on_grid(deadline: float, period_s: float, now: float) -> float:
    """The deadline after this one; missed passes are skipped."""
    return deadline + period_s * max(1, math.ceil((now - deadline) / period_s))


class ActiveShow:
    """The show of the stage, from one to the next."""

    def __init__(self, stage: FrameReader) -> None:
        self._stage = stage
        self._generation = stage.generation - 1
        self._taken: tuple[str, bytes] | None = None
        self._is_new = False

    def is_new(self, now: float) -> bool:
        """Whether the stage dances another show than the one loaded last, or an edited one."""
        self._stage.newest(now)
        if self._stage.facts is not None and self._stage.generation != self._generation:
            self._generation = self._stage.generation
            self._is_new = self._written() != self._taken
        return self._is_new

    def load(self) -> Show:
        """The show of the stage. Raises ConfigError when its folder is broken by now."""
        self._taken, self._is_new = self._written(), False
        assert self._stage.facts is not None, "only a new show is loaded"
        return load_show(self._stage.facts.show_directory)

    def _written(self) -> tuple[str, bytes] | None:
        """The identity of a show: its folder and the text of show.yaml."""
        if self._stage.facts is None:
            return None
        folder = self._stage.facts.show_directory
        try:
            return str(folder), (folder / "show.yaml").read_bytes()
        except OSError:
            return str(folder), b""


class Speaking:
    """Tells the wires when this box takes over, and when it cedes. A box without a pair always speaks."""

    def __init__(self, box: BoxConfig, universes: Sequence[Universe]) -> None:
        self._pair, self._universes = box.pair, universes
        self._reader = None if box.pair is None else PartReader(runtime_folder(box))
        self._speaks = box.pair is None

    def may_speak(self, now: float) -> bool:
        """Whether universes may leave; monotonic seconds."""
        if self._reader is None or self._pair is None:
            return True
        part = self._reader.read()
        speaks = part is not None and part.may_speak(now)
        if speaks != self._speaks:
            self._speaks = speaks
            for universe in self._universes:
                if part is not None and speaks:
                    universe.take_over(self._pair.priority * max(0, part.epoch - 1), now)
                else:
                    universe.cede(now)
        return speaks

    def wait(self, deadline: float, period_s: float) -> float | None:
        """While silent: until the next pass on the grid, or until this box leads. None: it speaks."""
        if self._speaks:
            return None
        deadline = _next_on_grid(deadline, period_s, time.monotonic())
        while (left_s := deadline - time.monotonic()) > 0.0:
            time.sleep(min(_LOOK_S, left_s))
            if self.may_speak(time.monotonic()):
                return time.monotonic()
        return deadline

    def close(self) -> None:
        if self._reader is not None:
            self._reader.close()
