"""One picture: follow the stage, read the show state, draw the dance, lay it onto the wall."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import moderngl
import numpy as np

from appliance.box.show_state import ShowStateReader
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.shared_frame import Facts
from appliance.pose.skeleton import Skeleton
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass, picture_size
from appliance.projector.interpolation import Interpolation
from appliance.projector.moment import Moment
from appliance.projector.pacing import USUAL_RATE
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.wall import Wall
from appliance.projector.presence import STALE_S, Presence
from appliance.projector.resolution import SHARES
from appliance.projector.window import Size
from appliance.show.config_error import ConfigError
from appliance.show.look import LookConfig, looks_by_name
from appliance.show.projector import ProjectorConfig
from appliance.show.show import load_show

Looks = Mapping[str, LookConfig]


class Painter(Protocol):
    """What draws the looks of one show."""

    def draw(
        self, moment: Moment, look: str, look_before: str, mix: float, target: Wall | moderngl.Framebuffer
    ) -> None: ...

    def release(self) -> None: ...


MakePainter = Callable[[moderngl.Context, Size, Skeleton, Looks], Painter]


class Projector:
    """Shows any stage, black while there is none; a restarted stage is shown with its first frame."""

    def __init__(
        self,
        gl: moderngl.Context,
        config: ProjectorConfig,
        reader: FrameReader,
        show_state: ShowStateReader,
        controls: Controls,
        say: Callable[[str], None],
        make_painter: MakePainter = Renderer,
    ) -> None:
        self._gl, self._config, self._make_painter = gl, config, make_painter
        self._reader, self._show_state, self._controls, self._say = reader, show_state, controls, say
        self._final = FinalPass(gl, config)
        self._presence = Presence(config.rate or USUAL_RATE)
        self._generation = 0
        self._poses: Interpolation | None = None
        self._painter: Painter | None = None
        self._drawn: tuple[Skeleton, Looks] | None = None  # what the painter was made for
        self._to_draw: tuple[Skeleton, Looks] | None = None  # a show that waits for its painter
        self._is_black = False  # since that show waits
        self.shown: str | None = None  # the look of the last picture; None: none, or two that cross-fade
        self.is_preparing = False  # no watchdog counts meanwhile

    @property
    def sees_stage(self) -> bool:
        """Whether the dance on the wall is fresh; a pause of this process does not count."""
        return self._presence.sees_stage

    def draw(
        self,
        now: float,
        screen: moderngl.Framebuffer,
        display: Size,
        lines: tuple[str, ...] = (),
        share: float = 1.0,
    ) -> float | None:
        """Draw the picture for `now` (monotonic seconds) onto a display of that size in pixels.

        lines: figures to show; share: of the display's size, for the scene, unless the box file sets that
        size. Returns when the shown frame left the stage; None while no fresh dance is seen.
        """
        self.shown = None
        self._follow_stage(now)
        moment = self._moment(now)
        if self._to_draw is not None and moment is not None:
            self._prepare(self._to_draw, moment, screen, display, share)
        newest = self._poses.newest if self._poses is not None and self._drawn is not None else None
        presence = self._presence.step(newest, now)
        show_state = self._show_state.read()
        level = show_state.level(now) * presence
        is_drawn = self._painter is not None and moment is not None and level > 0.0
        size = picture_size(self._config, display, share)
        wall = self._final.wall(screen, display, self._controls, level, size, lines)
        if self._painter is not None and moment is not None and is_drawn:
            mix = show_state.look_mix(now)
            self._painter.draw(moment, show_state.look, show_state.look_before, mix, wall)
            self.shown = show_state.look if mix in (0.0, 1.0) else None
        show_state = self._show_state.read()  # again: this picture already shows a panic that came meanwhile
        if show_state.panic or show_state.blackout:
            self._final.black(screen, display)
            self.shown = None
            return None
        if wall.framebuffer is not screen or not is_drawn:
            seen = min(level, show_state.level(now)) if is_drawn else 0.0
            self._final.draw(screen, display, self._controls, seen, lines)
        is_fresh = newest is not None and now - newest < STALE_S
        return self._poses.left_stage(moment) if self._poses and moment and is_drawn and is_fresh else None

    def release(self) -> None:
        """Give the GPU's memory back."""
        if self._painter is not None:
            self._painter.release()
        self._final.release()

    def _moment(self, now: float) -> Moment | None:
        """Where the dancer is; None before a stage's first frame."""
        if self._poses is None:
            return None
        if self._reader.generation == self._generation:
            self._poses.take(now)
        return self._poses.moment(now)

    def _follow_stage(self, now: float) -> None:
        """Switch to another stage with its first frame; another show is prepared in the dark."""
        self._reader.is_alive(now)  # attaches to another stage
        first = self._reader.newest(now) if self._reader.generation != self._generation else None
        if first is not None and self._reader.facts is not None:
            self._generation = self._reader.generation
            self._switch_to(self._reader.facts)

    def _prepare(
        self,
        show: tuple[Skeleton, Looks],
        moment: Moment,
        screen: moderngl.Framebuffer,
        display: Size,
        share: float,
    ) -> None:
        """Draw each look once, unseen: drivers defer work to the first use, which would halt the dance.

        Cross-faded with itself, onto a texture and onto the display: drivers compile shaders again for each.
        """
        if not self._is_black:
            self._is_black = True
            return
        if self._painter is not None:  # one picture later, so that the fade excludes that time
            self._drawn, self._to_draw = show, None
            return
        self.is_preparing = True
        self._painter = self._make_painter(self._gl, picture_size(self._config, display), *show)
        for part in (SHARES[-1], share):
            size = picture_size(self._config, display, part)
            wall = self._final.wall(screen, display, self._controls, 1.0, size)
            for look in show[1]:
                self._painter.draw(moment, look, look, 0.5, wall)
        self._gl.finish()
        self.is_preparing = False

    def _switch_to(self, facts: Facts) -> None:
        self._poses = Interpolation(self._reader)
        show = (facts.skeleton, self._looks(facts))
        if self._drawn is not None and _are_alike(self._drawn, show):
            return
        if self._painter is not None:
            self._painter.release()
        self._painter = self._drawn = None
        self._presence.hide()
        self._to_draw, self._is_black = show, False

    def _looks(self, facts: Facts) -> Looks:
        try:
            return looks_by_name(load_show(facts.show_directory).config.looks)
        except ConfigError as error:
            self._say(
                f"{error} The audience sees the built-in looks. Correct the show, then start the stage again."
            )
            return looks_by_name(())


def _are_alike(one: tuple[Skeleton, Looks], other: tuple[Skeleton, Looks]) -> bool:
    return (
        one[0].same_joints(other[0])
        and np.array_equal(one[0].offsets, other[0].offsets)
        and one[0].ends == other[0].ends
        and np.array_equal(one[0].standing, other[0].standing)
        and list(one[1].items()) == list(other[1].items())
    )
