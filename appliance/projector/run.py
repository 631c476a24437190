"""The projector's own process: window, keys and orders, one picture after the other, until it is stopped."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import moderngl

from appliance.box.durable import write_whole
from appliance.box.fallback import Fallbacks
from appliance.box.notify import Notifier
from appliance.box.orders import OrderInbox
from appliance.box.process_health import ProcessHealthWriter
from appliance.box.runtime_folder import AlreadyHereError, Claim, runtime_folder
from appliance.box.show_state import ShowStateReader
from appliance.box.watchdog import Patience, end_process, guarded
from appliance.levers.show_state import ShowState
from appliance.levers.table import LOOK
from appliance.outputs.frame_reader import FrameReader
from appliance.pair.part import DarkWhileFollowing
from appliance.projector.alignment import AlignmentFile, alignment_folder
from appliance.projector.context import GlContext
from appliance.projector.controls import Controls
from appliance.projector.fallback import (
    OF_THE_PROJECTOR,
    PICTURES_SMALLER,
    STAGE_UNSEEN,
    about_resolution,
    about_software,
)
from appliance.projector.info import Figures, Meter
from appliance.projector.keys import press
from appliance.projector.pacing import USUAL_RATE, Pacing
from appliance.projector.png import write_png
from appliance.projector.projector_error import GPU_LOST, NO_DISPLAY, NO_PLACE, ProjectorError
from appliance.projector.raw_stream import RawStream
from appliance.projector.resolution import Resolution
from appliance.projector.seen_wall import SeenWall
from appliance.projector.stamp import stamp
from appliance.projector.stream.feed import Feed
from appliance.projector.stream.keying import keyed
from appliance.projector.window import Kind, Size, Window
from appliance.show.box import BoxConfig

_log = logging.getLogger(__name__)

SHOWS_FOR_S = 600.0  # the test card of the first start
MARK = "used"  # in the box's state folder: this box has been used

PATIENCE_S = 5.0  # with a display that takes no picture
_DISPLAY_HANGS = (
    f"The display has taken no picture for {PATIENCE_S:g} s. The audience sees one that stands still, or "
    "none; the dance goes on. The projector ends so that it can be started again (a supervisor does it by "
    "itself); if it happens often, look at the cable, the projector and the graphics card's driver."
)

_ORDERS_A_PICTURE = 8
_REPORT_S = 1.0
_JUDGED_AFTER = 20  # pictures of the dance: then software's frame rate is known


@dataclass(frozen=True)
class Options:
    """The options of the command line. kind None: as the box file says; frames: a folder for PNGs.

    stamps: draw the held joint's rotation into each picture's corner; raw: a descriptor for raw pictures;
    is_keyed: pictures that are written have alpha, as much as they shine;
    card: lines for the test card besides the projector's own figures, asked for once a second while it shows;
    is_first: nobody gave this box a show, so at its first start the test card comes by itself.
    """

    kind: Kind | None = None
    size: Size | None = None
    frames: Path | None = None
    seconds: float | None = None
    shows_info: bool = False
    stamps: bool = False
    raw: int | None = None
    is_keyed: bool = False
    card: Callable[[], tuple[str, ...]] = tuple
    is_first: bool = False


class Run:
    """Everything open while the projector runs. Raises ProjectorError, ConfigError or RuntimeFolderError."""

    def __init__(self, box: BoxConfig, options: Options) -> None:
        config = box.projector
        self._options = options
        with ExitStack() as opened:
            folder = runtime_folder(box)
            self._window = Window(
                config, options.kind or ("fullscreen" if config.fullscreen else "window"), options.size
            )
            opened.callback(self._window.close)
            self.context = GlContext(self._window)
            opened.callback(self.context.close)
            from appliance.projector.loop import Projector  # without a display nothing draws

            self._raw = None if options.raw is None else RawStream(options.raw, is_keyed=options.is_keyed)
            if self._raw is not None:
                opened.callback(self._raw.close)
            self._feed = None if config.stream is None else Feed(config.stream)
            if self._feed is not None:
                opened.callback(self._feed.close)
            self._seen_wall = SeenWall(folder)
            opened.callback(self._seen_wall.close)
            self._file = AlignmentFile(alignment_folder(box), config)
            opened.callback(self._file.close)
            self._controls = Controls(self._file.alignment, self._file.keep, options.shows_info)
            self._first_start: FirstStart | None = None
            if options.is_first:
                self._first_start = FirstStart(alignment_folder(box), (self._file.path, box.sensors.keys))
                self._controls.shows_test_card = self._first_start.is_on
            self._inbox = _open_inbox(folder, opened)
            self.fallbacks = Fallbacks(OF_THE_PROJECTOR)
            self._health = ProcessHealthWriter(folder, "projector", self.fallbacks)
            opened.callback(self._health.close)
            self.reader = FrameReader(folder)
            opened.callback(self.reader.close)
            is_dark = box.pair is not None and box.pair.picture == "black"
            self._show_state = DarkWhileFollowing(folder) if is_dark else ShowStateReader(folder)
            opened.callback(self._show_state.close)
            self.projector = Projector(self.context.gl, config, self.reader, self._show_state, self._controls)
            opened.callback(self.projector.release)
            self._closing = opened.pop_all()
        rate = config.rate or self._window.display_rate or USUAL_RATE
        self._pacing = Pacing(rate, self._window.set_pace(config.vsync))
        self._resolution = Resolution(self._pacing.period_s, adapts=config.picture is None)
        self._is_resolution_said = False
        self._meter = Meter()
        self._patience = Patience(PATIENCE_S)
        self._info_lines: tuple[str, ...] = ()
        self._card_lines: tuple[str, ...] = ()
        self._is_software_said = not self.context.is_software

    def introduction(self) -> list[str]:
        """Facts for the technician at the start."""
        width, height = self._window.size
        lines = [
            f"The picture is {width}x{height} ({self._window.driver}, {self.context.renderer}). "
            f"Its alignment is kept in {self._file.path}.",
            *self._file.overrides(),
        ]
        keyboards = self._window.keyboards
        if keyboards is not None and keyboards.is_refused:
            lines.append(
                "No keyboard can be read: the picture is laid onto the wall by OSC alone. "
                "Put this user into the group input for keys."
            )
        elif self._window.kind != "offscreen":
            lines.append("Keys work on the picture: h lists them, q ends.")
        return lines

    def project(self, stopped: Callable[[], bool], notifier: Notifier | None = None) -> Figures:
        """Show pictures until `stopped`, the end of the seconds, or a key; returns how they came out."""
        notifier = notifier or Notifier({})
        end = partial(end_process, _DISPLAY_HANGS, GPU_LOST)
        try:
            with guarded(self._patience, lambda: self.projector.is_preparing, end, is_well=notifier.ping):
                self._show_pictures(stopped, notifier)
            self._health.end(time.monotonic())
        except moderngl.Error as error:
            self._check_context()
            raise ProjectorError(
                f"The graphics card refuses to draw ({error}). The audience sees no picture; the dance goes "
                "on. Update its driver, or use another machine.",
                NO_DISPLAY,
            ) from error
        return self._meter.figures()

    def close(self) -> None:
        self._closing.close()

    def _show_pictures(self, stopped: Callable[[], bool], notifier: Notifier) -> None:
        begun = reported = time.monotonic()
        while not stopped() and not self._controls.is_over and not (self._raw and self._raw.is_closed):
            now = self._pacing.wait_for_next()
            if self._options.seconds is not None and now - begun >= self._options.seconds:
                return
            self._press_keys()
            self._carry_out_orders()
            self._show(now)
            if self._meter.pictures == 1:
                notifier.ready("The display shows pictures.")
            if now - reported >= _REPORT_S:
                reported = now
                self.report(now)

    def _show(self, now: float) -> None:
        screen, size, begun = self.context.gl.screen, self._window.size, time.monotonic()
        lines = self._info_lines if self._controls.shows_info else ()
        lines = self._card_lines if self._controls.shows_test_card else lines
        left_stage = self.projector.draw(now, screen, size, lines, self._resolution.share)
        if self._options.stamps:
            stamp(screen, self._meter.pictures, self.projector.held if left_stage is not None else None)
        read = partial(screen.read, viewport=(0, 0, *size), components=4)
        if self._options.frames is not None:
            pixels = keyed(read()) if self._options.is_keyed else read()
            self._write_png(self._options.frames, pixels, size)
        if self._raw is not None:
            self._raw.offer(read(), size)
        if self._feed is not None:
            self._feed.offer(now, size, read)
        if not (self._controls.shows_test_card or self._controls.shows_info):  # with the PIN in them
            self._seen_wall.offer(now, size, read)
        self.context.finish()  # else the driver queues pictures, and each is older when shown
        drawn = time.monotonic()
        self._window.show()
        swapped = time.monotonic()
        self._patience.note_sign(swapped)
        self._meter.note_swap(swapped, left_stage)
        look = self.projector.shown if left_stage is not None else None
        if self._resolution.note_picture(drawn, drawn - begun, look):
            self._report_resolution()
        self._check_context()

    def _report_resolution(self) -> None:
        """Report it once; afterwards the figures show it."""
        if not self._is_resolution_said:
            self._is_resolution_said = True
            rate = 1.0 / self._pacing.period_s
            _log.warning(about_resolution(self._resolution.share, self._window.size, rate))

    def _write_png(self, folder: Path, pixels: bytes, size: Size) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_png(folder / f"frame-{self._meter.pictures:06d}.png", pixels, *size)
        except OSError as error:
            raise ProjectorError(
                f"{folder}: pictures cannot be written there ({error.strerror}). The projector ends; the "
                "dance goes on. Free some room, or name another folder after --frames.",
                NO_PLACE,
            ) from error

    def _press_keys(self) -> None:
        for key in self._window.events():
            if key is None:
                self._controls.is_over = True
                continue
            message = press(key, self._controls, self._window.size)
            if message:
                _log.info(message)
        if self._controls.wants_fullscreen:
            self._controls.wants_fullscreen = False
            self._window.toggle_fullscreen()

    def _carry_out_orders(self) -> None:
        if self._inbox is None:
            return
        for _ in range(_ORDERS_A_PICTURE):
            order = self._inbox.take()
            if order is None:
                return
            self._inbox.answer(order, *self._controls.carry_out(order))

    def report(self, now: float) -> None:
        """Once a second: to the box's other processes, onto the picture and to the terminal."""
        figures = self._meter.figures()
        state = self.reader.state(now)
        width, height = self._window.size
        share = self._resolution.share
        self._publish_health(now, state, share)
        self._end_first_start(now)
        has_lettering = self._controls.shows_info or self._controls.shows_test_card
        where = self._options.card() if has_lettering else ()
        drawn_at = "" if share == 1.0 else f" at {share:.0%}"
        age = "-" if figures.age_p50_ms is None else f"{figures.age_p50_ms:.0f} / {figures.age_p99_ms:.0f} ms"
        self._info_lines = (
            f"{figures.rate:.1f} pictures/s",
            f"frame age {age}",
            f"stage {state}",
            f"look {self._show_state.read()[LOOK].value or 'of the show'}",
            f"{width}x{height}{drawn_at} {'software' if self.context.is_software else self._window.driver}",
            *(where if self._controls.shows_info else ()),
        )
        self._card_lines = (socket.gethostname(), *where, f"{width}x{height} {self._window.driver}")
        if self._options.shows_info:
            _log.info(f"{figures.sentence()}, {width}x{height}{drawn_at}, stage {state}")
        if not self._is_software_said and figures.dances >= _JUDGED_AFTER:
            self._is_software_said = True
            _log.warning(about_software(figures.rate, 1.0 / self._pacing.period_s, self.context.renderer))

    def _end_first_start(self, now: float) -> None:
        if self._first_start is None or not self._first_start.is_on:
            return
        newest = self.reader.newest(now)
        sequence = -1 if newest is None else newest.sensor_sequence
        if self._first_start.is_over(now, sequence, self._show_state.read(), self._controls.shows_test_card):
            _log.info(self._controls.set_test_card(False))

    def _publish_health(self, now: float, stage: str, share: float) -> None:
        """Publish for the box's other processes; a stage that was never seen does not count as away."""
        if self.reader.facts is not None:
            self.fallbacks.set(STAGE_UNSEEN.name, stage != "fresh" and not self.projector.sees_stage)
        self.fallbacks.set(PICTURES_SMALLER.name, share < 1.0)
        self._health.reported = self._controls.report()
        self._health.publish_health(now)

    def _check_context(self) -> None:
        if self.context.is_lost:
            raise ProjectorError(
                "The graphics card was reset, and all that was on it is gone. The audience sees black; the "
                "dance goes on. Start the projector again (a supervisor does it by itself); if it happens "
                "often, look at the card's cooling and power.",
                GPU_LOST,
            )


def _open_inbox(folder: Path, opened: ExitStack) -> OrderInbox | None:
    """The inbox for orders by OSC; without it keys still work, and the dance is shown."""
    try:
        opened.callback(Claim(folder, "projector").close)
        inbox = OrderInbox(folder, "projector")
    except AlreadyHereError:
        _log.warning(
            "Another projector of this box takes the orders by OSC. The audience sees the dance on both. "
            "End one of them if that was not meant."
        )
        return None
    except OSError as error:
        _log.warning(
            f"{folder}: no place for orders by OSC ({error.strerror}). The dance is shown; corners and "
            "brightness are set by keys alone. Make room in this folder."
        )
        return None
    opened.callback(inbox.close)
    return inbox


class FirstStart:
    """Whether the test card shows by itself: once in a box's life, until a sensor is heard or commands come.

    folder: for MARK, afterwards. If it cannot be written, the card never shows, as it would come back at each
    power-on, even in the middle of an evening. signs_of_use: files that a new box does not have.
    """

    def __init__(self, folder: Path, signs_of_use: tuple[Path | None, ...] = ()) -> None:
        self._mark = folder / MARK
        signs = (self._mark, *(one for one in signs_of_use if one is not None))
        self.is_on = not any(one.exists() for one in signs) and os.access(folder, os.W_OK)
        self._since: float | None = None

    def is_over(self, now: float, sensor_sequence: int, show_state: ShowState, is_shown: bool = True) -> bool:
        """True once, when the card goes. now: monotonic seconds; sensor_sequence: the newest frame's, -1
        before a sensor was heard; is_shown: False after a person switched the card off."""
        if not self.is_on:
            return False
        self._since = now if self._since is None else self._since
        is_unused = is_shown and sensor_sequence < 0 and not show_state.settings
        if is_unused and now - self._since < SHOWS_FOR_S:
            return False
        self.is_on = False
        with contextlib.suppress(OSError):
            write_whole(self._mark, b"")
        return True
