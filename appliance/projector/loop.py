"""One picture: follow the stage, read the show state, draw the dance, lay it onto the wall."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import moderngl
import numpy as np

from appliance.body.mesh_file import MESH_FILE
from appliance.box.pace import Pace
from appliance.box.show_state import ShowStateReader
from appliance.levers.table import CAMERA, LOOK
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.shared_frame import Facts
from appliance.pose.skeleton import Skeleton
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass, picture_size
from appliance.projector.interpolation import Interpolation
from appliance.projector.moment import Moment
from appliance.projector.pacing import USUAL_RATE
from appliance.projector.picture.camera import NOT_CUED, CuedCamera
from appliance.projector.picture.cards import Cards
from appliance.projector.picture.image_file import read_image
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.test_card import Image, test_card
from appliance.projector.picture.wall import DETAILS, Detail, Wall
from appliance.projector.resolution import SHARES
from appliance.projector.window import Size
from appliance.show.card import CardConfig, cards_by_name
from appliance.show.config_error import ConfigError
from appliance.show.look import LookConfig, looks_by_name
from appliance.show.projector import ProjectorConfig
from appliance.show.show import load_show

_log = logging.getLogger(__name__)

STALE_S = 0.5
FADE_S = 0.5
_LONGEST_STEP_S = 0.25  # after a longer pause the fade still takes at least two pictures

_DRAWING_SHARE = 0.45  # fraction of the display's period; cards, masks and other programs need the rest
_TRIES = 2  # the faster one counts
PAGE = "page "  # begins the line of the test card that has the page's address

Looks = Mapping[str, LookConfig]


class Painter(Protocol):
    """Draws the looks of one show."""

    def draw(
        self,
        moment: Moment,
        look: str,
        look_before: str,
        mix: float,
        target: Wall | moderngl.Framebuffer,
        cued: CuedCamera = NOT_CUED,
    ) -> None: ...

    def release(self) -> None: ...


MakePainter = Callable[[moderngl.Context, Skeleton, Looks, Path], Painter]
KEEPING: MakePainter = partial(Renderer, keeps_strokes=True)


class Projector:
    """Shows any stage, black while there is none; a restarted stage is shown with its first frame."""

    def __init__(
        self,
        gl: moderngl.Context,
        config: ProjectorConfig,
        reader: FrameReader,
        show_state: ShowStateReader,
        controls: Controls,
        make_painter: MakePainter = KEEPING,
    ) -> None:
        self._gl, self._config, self._make_painter = gl, config, make_painter
        self._reader, self._show_state, self._controls = reader, show_state, controls
        self._final = FinalPass(gl, config)
        self._presence = Presence(config.rate or USUAL_RATE)
        self._generation = 0
        self._poses: Interpolation | None = None
        self._painter: Painter | None = None
        self._cards: Cards | None = None
        self._drawn_show: ShownShow | None = None  # what the painter draws
        self._next_show: ShownShow | None = None  # waits for its painter
        self._is_black = False  # the display is, since that show waits
        self._read: set[tuple[str, int]] = set()  # images that were sound, and when they were changed
        self._detail = DETAILS[0]
        self._test_card: Image | None = None
        self._test_card_of: tuple[object, ...] = ()
        self.shown: str | None = None  # the look of the last picture; None: none, or two that cross-fade
        self.is_preparing = False  # no watchdog counts meanwhile
        self.held: list[float] | None = None  # rotation in the world (w, x, y, z) of the held joint

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
        self.held = _held(moment) if moment is not None else None
        if self._next_show is not None and moment is not None:
            self._prepare(self._next_show, moment, screen, display, share)
        newest = self._poses.newest if self._poses is not None and self._drawn_show is not None else None
        presence = self._presence.step(newest, now)
        show_state = self._show_state.read()
        if self._controls.shows_test_card and not (show_state.panic or show_state.blackout):
            self._draw_test_card(screen, display, lines)
            return None
        level = show_state.level(now) * presence
        is_drawn = self._painter is not None and moment is not None and level > 0.0
        size = self._picture_size(display, share)
        detail = self._detail if share == 1.0 else DETAILS[0]
        wall = self._final.wall(screen, display, self._controls, level, size, lines, detail)
        if self._painter is not None and moment is not None and is_drawn:
            look, camera = show_state[LOOK], show_state[CAMERA]
            mix = look.share(now)
            cued = CuedCamera(camera.before, camera.value, camera.share(now))
            self._painter.draw(moment, look.value, look.before, mix, wall, cued)
            if self._cards is not None:
                self._cards.draw(wall, show_state, now)
            self.shown = look.value if mix in (0.0, 1.0) else None
        show_state = self._show_state.read()  # again: this picture already shows a panic that came meanwhile
        if show_state.panic or show_state.blackout:
            self._final.black(screen, display)
            self.shown = None
            return None
        if wall.framebuffer is not screen or not is_drawn:
            seen = min(level, show_state.level(now)) if is_drawn else 0.0
            self._final.draw(screen, display, self._controls, seen, lines)
        self._final.darken(screen, display, self._controls)
        is_fresh = newest is not None and now - newest < STALE_S
        return self._poses.left_stage if self._poses and moment and is_drawn and is_fresh else None

    def _draw_test_card(self, screen: moderngl.Framebuffer, display: Size, lines: tuple[str, ...]) -> None:
        """Made again where words or size have changed. The line that begins with PAGE is its address."""
        size = self._picture_size(display)
        blend = self._config.edge_blend
        shared = None if blend is None else (blend.part, self._controls.alignment.overlap)
        if self._test_card is None or self._test_card_of != (size, lines):
            address = next((line.removeprefix(PAGE) for line in lines if line.startswith(PAGE)), "")
            self._test_card, self._test_card_of = test_card(size, lines, address, shared), (size, lines)
        self._final.show_image(self._test_card)
        self._final.draw(screen, display, self._controls, 1.0, ())
        self._final.darken(screen, display, self._controls)

    def _picture_size(self, display: Size, share: float = 1.0) -> Size:
        return picture_size(self._config, display, self._controls.alignment.overlap, share)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._release_show()
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
            self.is_preparing = True  # large images take seconds to read
            self._switch_to(self._reader.facts)
            self.is_preparing = False

    def _prepare(
        self,
        show: ShownShow,
        moment: Moment,
        screen: moderngl.Framebuffer,
        display: Size,
        share: float,
    ) -> None:
        """Called for three pictures: one is black; before the next, everything is made; the third begins the
        fade, which excludes that time.

        Draws each look once, unseen: drivers defer work to the first use, which would halt the dance. Each is
        cross-faded with itself, onto a texture and onto the display: shaders are compiled again for those.
        """
        if not self._is_black:
            self._is_black = True
            return
        if self._painter is not None:
            self._drawn_show, self._next_show = show, None
            return
        self.is_preparing = True
        self._painter = self._make_painter(self._gl, show.skeleton, show.looks, show.directory)
        self._cards = Cards(self._gl, show.cards, show.directory)
        for part in (SHARES[-1], share):
            size = self._picture_size(display, part)
            wall = self._final.wall(screen, display, self._controls, 1.0, size)
            for look in show.looks:
                self._painter.draw(moment, look, look, 0.5, wall)
        self._gl.finish()
        self._detail = self._affordable_detail(moment, show, screen, display)
        self.is_preparing = False

    def _affordable_detail(
        self, moment: Moment, show: ShownShow, screen: moderngl.Framebuffer, display: Size
    ) -> Detail:
        """The finest that this machine draws in time, measured with the look that takes longest."""
        size = self._picture_size(display)

        def drawn(look: str, detail: Detail) -> None:
            assert self._painter is not None
            wall = self._final.wall(screen, display, self._controls, 1.0, size, detail=detail)
            self._painter.draw(moment, look, look, 1.0, wall)
            self._gl.finish()

        def took_s(look: str) -> float:
            began = time.perf_counter()
            drawn(look, DETAILS[0])
            return time.perf_counter() - began

        dearest = max(show.looks, key=took_s)
        return affordable_detail(partial(drawn, dearest), 1.0 / (self._config.rate or USUAL_RATE))

    def _switch_to(self, facts: Facts) -> None:
        self._poses = Interpolation(self._reader, self._config.prediction_ms / 1000.0)
        show = self._loaded(facts)
        if self._drawn_show is not None and self._drawn_show.is_like(show):
            return
        self._release_show()
        self._drawn_show = None
        self._presence.hide()
        self._next_show, self._is_black = show, False

    def _release_show(self) -> None:
        if self._painter is not None:
            self._painter.release()
        if self._cards is not None:
            self._cards.release()
        self._painter = self._cards = None

    def _loaded(self, facts: Facts) -> ShownShow:
        directory = facts.show_directory
        try:
            config = load_show(directory).config
            looks = self._with_images(looks_by_name(config.looks, directory))
            cards = cards_by_name(config.cards)
        except ConfigError as error:
            _log.warning(
                f"{error} The audience sees the built-in looks. Correct the show, then start the stage again."
            )
            looks, cards = looks_by_name(()), cards_by_name(())
        names = [MESH_FILE, *(look.image or look.video for look in looks.values())]
        names += [card.image for card in cards.values()]
        names += [card.font for card in cards.values()]
        changed = tuple(_changed_at(directory / name) for name in names if name is not None)
        return ShownShow(facts.skeleton, looks, cards, directory, changed)

    def _with_images(self, looks: Looks) -> Looks:
        """The looks without the images that cannot be read."""
        usable = dict(looks)
        for name, look in looks.items():
            try:
                if look.image is None or (image := (look.image, _changed_at(Path(look.image)))) in self._read:
                    continue
                read_image(look.image)
                self._read.add(image)
            except OSError as error:
                _log.warning(
                    f"{look.image} cannot be read as an image ({error}). The audience sees the look '{name}' "
                    "without it. Save it anew."
                )
                usable[name] = look.model_copy(update={"image": None})
        return usable


@dataclass(frozen=True)
class ShownShow:
    """The projector's view of a show. changed_at: of its body, images and fonts."""

    skeleton: Skeleton
    looks: Looks
    cards: Mapping[str, CardConfig]
    directory: Path
    changed_at: tuple[int, ...]

    def is_like(self, other: ShownShow) -> bool:
        """Whether the other one can be drawn with what was made for this one."""
        one, another = self.skeleton, other.skeleton
        return (
            one.same_joints(another)
            and np.array_equal(one.offsets, another.offsets)
            and one.ends == another.ends
            and np.array_equal(one.standing, another.standing)
            and list(self.looks.items()) == list(other.looks.items())
            and self.cards == other.cards
            and self.changed_at == other.changed_at
        )


def _held(moment: Moment) -> list[float]:
    """World rotation of the joint that a hand holds most firmly; of the root where none is held."""
    puppet = moment.puppets[0]
    joint = 0 if puppet.holds is None else int(np.argmax(puppet.holds))
    rotation: list[float] = puppet.world[joint].tolist()
    return rotation


def _changed_at(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def affordable_detail(
    draw: Callable[[Detail], None], period_s: float, clock: Callable[[], float] = time.perf_counter
) -> Detail:
    """The finest detail that takes no more than _DRAWING_SHARE of a period. draw: draws once and waits.

    Tries them from the coarsest, which every machine draws, up to the first that takes too long.
    """
    best = DETAILS[0]
    for detail in DETAILS:
        draw(detail)  # drivers defer work to the first use
        took_s = []
        for _ in range(_TRIES):
            began = clock()
            draw(detail)
            took_s.append(clock() - began)
        if min(took_s) > _DRAWING_SHARE * period_s:
            break
        best = detail
    return best


class Presence:
    """A level from 0 to 1 that follows whether fresh frames come; it starts in the dark.

    rate: the intended pictures a second. A pause of this process, usually of the whole machine, counts
    neither for the fade nor against the stage; slow drawing does.
    """

    def __init__(self, rate: float = USUAL_RATE) -> None:
        self.level = 0.0
        self._pace = Pace(_LONGEST_STEP_S, rate)
        self._unseen_s = math.inf  # age of the newest frame, without the pauses of this process

    @property
    def sees_stage(self) -> bool:
        """Whether the last picture had a fresh frame."""
        return self._unseen_s < STALE_S

    def step(self, newest: float | None, now: float) -> float:
        """The level at `now`; `newest`: when the newest frame was, None without one (monotonic seconds)."""
        elapsed_s = self._pace.step_s(now)
        self._unseen_s = math.inf if newest is None else min(self._unseen_s + elapsed_s, now - newest)
        if self.sees_stage:
            self.level = min(1.0, self.level + elapsed_s / FADE_S)
        else:
            self.level = max(0.0, self.level - elapsed_s / FADE_S)
        return self.level

    def hide(self) -> None:
        """Black at once, then a fade-in: another show has begun."""
        self.level = 0.0
