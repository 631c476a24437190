"""The generator's process: makes what the show state asks for, and the next of it before it is needed."""

from __future__ import annotations

import contextlib
import ctypes
import math
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from appliance.box.fallback import Fallbacks
from appliance.box.log_writer import LogWriter
from appliance.box.made_motion import FOLDER, MadeMotion, MadeMotionWriter
from appliance.box.notify import Notifier
from appliance.box.process_health import ProcessHealthWriter
from appliance.box.realtime import give_way
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.show_state import ShowStateReader
from appliance.box.stop_signals import stop_signals
from appliance.dancer.grounding import GroundingError
from appliance.dancer.loop import Loop
from appliance.dancer.material.maker import Maker
from appliance.dancer.material.material_file import (
    SUFFIX,
    Material,
    parsed_recipe,
    read_material,
    recipe_text,
    write_material,
)
from appliance.dancer.material.motion_network import MotionNetworkError
from appliance.dancer.material.prompt import end_of, prompt_of
from appliance.dancer.phrase import FPS, NUMBER, Phrase, PhraseError
from appliance.dancer.phrase_cache import MEMORY, PhraseCache
from appliance.generator.fallback import NOT_KEPT, NOT_MADE, OF_THE_GENERATOR
from appliance.generator.kept_motions import KeptMotions
from appliance.generator.wish import AGAIN, Wish, Wishes
from appliance.outputs.frame_reader import FrameReader
from appliance.pose.bvh import BvhError
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError
from appliance.show.show import Show, load_show
from appliance.show.sources import IMPROVISE, KEPT, MAIN
from appliance.show_control.orders import Order, OrderInbox

_LOOK_S = 0.05
_NICE = 10
_TAKEN_S = 5.0  # what is to be danced at once and is not taken over until then is made again
_REST_S = 0.2  # from one motion to the next, at least
_AHEAD_S = 1.2  # until an improvisation is made that is wanted at once
_FILES = 4  # the newest: the stage may still open the one before
_EACH = ("seed", "number", "after", "from_s", "prompt")
_MOST_NUMBERS = 10_000_000  # exact in the track's float32
_WRONG = (MotionNetworkError, GroundingError, PhraseError, BvhError, OSError, LookupError, ValueError)


class Generator:
    """Makes one show's motion. Raises OSError where the runtime folder takes no file."""

    def __init__(
        self, show: Show, box: BoxConfig, folder: Path, stage: FrameReader, fallbacks: Fallbacks
    ) -> None:
        config = show.config
        self._show, self._folder, self._stage, self._fallbacks = show, folder, stage, fallbacks
        self._wishes = Wishes(config)
        self._phrases = PhraseCache(show.directory, folder / MEMORY)
        self._loops: dict[str, Loop] = {}
        grounded = config.motion.grounded
        self._maker = Maker(show.skeleton, show.motion_networks, self._loop_of, grounded)
        taken = tuple(name for name in config.motion.sources if name not in config.motion.kept)
        self.kept = KeptMotions(folder, box.state_folder, show.skeleton.names, taken)
        self._writer = MadeMotionWriter(folder)
        self._told: list[str] | None = None
        self._wish: Wish | None = None  # what was made last was made for it
        self._recipe, self._returns = "", 0
        self._rests_until, self._taken_by = 0.0, math.inf
        self._number = 1000 + int(time.time()) % _MOST_NUMBERS

    def look(self, state_reader: ShowStateReader, now: float) -> bool:
        """Make what is wanted next, if anything is; whether it did."""
        if (names := sorted(self.kept.recipes)) != self._told:
            self._told = names
            self._writer.write_kept(names)
        self._fallbacks.set(NOT_KEPT.name, self.kept.complaint)
        health = self._stage.health() or {}
        base = str(health.get("base", MAIN))
        wanted = str(health.get("wanted", ""))
        wish = self._wishes.wish(state_reader.read(), base, self.kept.recipes, now, wanted)
        if wish is None:
            self._wish = None
            return False
        self._adopt(wish, str(health.get("made", "")))
        is_used = bool(self._recipe) and health.get("made") == self._recipe
        if wish != self._wish and now < self._rests_until:
            return False  # a hand draws over the map: the newest point counts
        is_unseen = not is_used and now > self._taken_by
        if wish != self._wish:
            self._returns = 0
        elif is_used and wish.is_new_at_return:
            self._returns += 1
        elif not is_unseen:
            return False
        at_once = wish != self._wish or is_unseen
        self._rests_until, self._taken_by = now + _REST_S, now + _TAKEN_S if at_once else math.inf
        self._make(wish, at_once)
        self._wish = wish
        return True

    def obey(self, order: Order) -> tuple[bool, str]:
        """Carry out an order of show control's: keep."""
        if order.name != "keep":
            return False, f"The generator knows no order '{order.name}'."
        danced = str((self._stage.health() or {}).get("made", ""))
        try:
            if not danced:
                raise ValueError("What is danced was not made ahead: there is nothing to keep.")
            number = parsed_recipe(danced)["number"]
            return True, self.kept.keep(order.text, self._file(number))
        except (ValueError, LookupError) as error:
            return False, str(error)

    def close(self) -> None:
        """Release the files; what was made stays."""
        self._writer.close()

    def _adopt(self, wish: Wish, danced: str) -> None:
        """After a restart: what is danced was made for this wish, and the next one follows at its return."""
        if self._wish is not None or not danced:
            return
        recipe, own = parsed_recipe(danced), wish.recipe
        returns = recipe.get("seed", 0) - own.get("seed", 0)
        if _character(recipe) == _character(own) and 0 <= returns < AGAIN:
            self._wish, self._recipe, self._returns = wish, danced, returns

    def _make(self, wish: Wish, at_once: bool) -> None:
        """Make a motion and hand it over; what cannot be made is reported, and tried with the next wish."""
        self._number = 1000 + (self._number + 1) % _MOST_NUMBERS
        recipe = {**wish.recipe, "number": self._number}
        if "seed" in recipe:
            recipe["seed"] += self._returns
        try:
            if recipe["source"] == IMPROVISE:
                recipe |= self._going_on(at_once)
            text, file = recipe_text(recipe), self._file(self._number)
            loop = self._numbered(wish.name) if recipe["source"] == KEPT else self._maker.make(recipe)
            write_material(file, Material(text, loop), self._show.skeleton.names)
            self._writer.write(MadeMotion(text, file.name, wish.name, at_once, recipe.get("from_s")))
        except _WRONG as error:
            self._fallbacks.set(NOT_MADE.name, f"{wish.name}: {error} The last phrase plays on.")
            return
        self._fallbacks.set(NOT_MADE.name, "")
        self._recipe = text
        give_back_memory()
        self._forget_old()

    def _going_on(self, at_once: bool) -> dict[str, Any]:
        """What an improvisation goes on from: a moment that is soon danced, or the end of another one."""
        health = self._stage.health() or {}
        name, danced = str(health.get("base", MAIN)), str(health.get("made", ""))
        if danced:
            number = int(parsed_recipe(danced)["number"])
            loop = read_material(self._file(number), self._show.skeleton.names).loop
        else:
            number, loop = [*self._show.phrases].index(name), self._loop_of(name)
        frame = float(end_of(loop))
        if at_once:
            told_at = float(health.get("looked_at", time.monotonic()))
            ahead_s = _AHEAD_S + time.monotonic() - told_at
            frame = round((float(health.get("position_s", 0.0)) + ahead_s - loop.start_s) * FPS)
            frame = frame % loop.period
        network = self._maker.network(IMPROVISE)
        prompt = prompt_of(loop, frame, self._show.skeleton, network, network.places)
        return {"after": number, "from_s": round(loop.start_s + frame / FPS, 2), "prompt": prompt}

    def _numbered(self, name: str) -> Loop:
        """A kept motion under the number of now."""
        loop = self.kept.material(name).loop
        track = loop.track.copy()
        track[:, NUMBER] = self._number
        return Loop.made(loop.poses, track, loop.step, loop.start_s)

    def _file(self, number: int) -> Path:
        return self._folder / FOLDER / f"{number}{SUFFIX}"

    def _forget_old(self) -> None:
        files = sorted((self._folder / FOLDER).glob(f"*{SUFFIX}"), key=lambda file: file.stat().st_mtime_ns)
        for file in files[:-_FILES]:
            file.unlink(missing_ok=True)

    def _loop_of(self, name: str) -> Loop:
        """The whole loop of a phrase, as the stage dances it."""
        if name not in self._loops:
            motion, names = self._show.config.motion, [*self._show.phrases]
            found = self._phrases.phrase(self._show.phrases[name], self._show.skeleton, motion.grounded)
            if found is None:
                raise ValueError(f"The phrase '{name}' has other joints than the show.")
            window, fade = 8, max(0, round(motion.crossfade_s * 50))
            phrase = Phrase(names.index(name), name, found[0], found[1], fade, window)
            part = (motion.start_s, motion.end_s) if name == MAIN else (0.0, None)
            self._loops = {MAIN: self._loops[MAIN]} if MAIN in self._loops else {}  # bounds the memory
            self._loops[name] = phrase.cut(*part)
        return self._loops[name]


def _character(recipe: Mapping[str, Any]) -> dict[str, Any]:
    """What is alike in the motions that are made for one wish."""
    return {name: value for name, value in recipe.items() if name not in _EACH}


def run_generator(directory: Path | None, box_file: Path | None) -> None:
    """Make motion until a signal comes; without a folder, for the show that the stage dances.

    Raises ConfigError for a show or box file that is broken, RuntimeFolderError without a place to meet.
    """
    box = load_box(box_file)
    give_way(_NICE)
    with stop_signals() as stopped, ExitStack() as opened:
        speaker = LogWriter()
        opened.callback(speaker.close)
        folder = runtime_folder(box)
        opened.callback(Claim(folder, "generator").close)
        notifier, stage, show_state = Notifier(), FrameReader(folder), ShowStateReader(folder)
        for one in (notifier, stage, show_state):
            opened.callback(one.close)
        inbox = OrderInbox(folder, "generator")
        opened.callback(inbox.close)
        fallbacks = Fallbacks(OF_THE_GENERATOR)
        health = ProcessHealthWriter(folder, "generator", fallbacks)
        opened.callback(health.close)
        notifier.ready("The generator makes what the stage asks for.")

        def pulse() -> None:
            now = time.monotonic()
            notifier.ping(now)
            health.publish_health(now)

        while not stopped():
            pulse()
            stage.newest(time.monotonic())
            if directory is None and stage.facts is None:
                time.sleep(_LOOK_S)
                continue
            is_over = partial(_has_changed, stage, stage.generation, directory, stopped)
            try:
                show = load_show(directory or _facts_folder(stage))
            except ConfigError as error:
                speaker.say(f"{error}\nNothing is made until the stage dances another show.")
                while not is_over():
                    pulse()
                    time.sleep(_LOOK_S)
                continue
            generator = Generator(show, box, folder, stage, fallbacks)
            with contextlib.closing(generator):
                _generate(generator, inbox, show_state, is_over, pulse)
        health.end(time.monotonic())


def give_back_memory() -> None:
    """What numpy and onnxruntime have freed goes back to the system: 20 MB of 130."""
    with contextlib.suppress(OSError, AttributeError):  # not the GNU C library
        ctypes.CDLL(None).malloc_trim(0)


def _generate(
    generator: Generator,
    inbox: OrderInbox,
    show_state: ShowStateReader,
    is_over: Callable[[], bool],
    pulse: Callable[[], None],
) -> None:
    while not is_over():
        generator.look(show_state, time.monotonic())
        while (order := inbox.take()) is not None:
            inbox.answer(order, *generator.obey(order))
        pulse()
        time.sleep(_LOOK_S)


def _has_changed(
    stage: FrameReader, generation: int, directory: Path | None, stopped: Callable[[], bool]
) -> bool:
    """Whether this show's time is over; keeps what is seen of the stage new."""
    stage.newest(time.monotonic())
    return stopped() or (directory is None and stage.generation != generation)


def _facts_folder(stage: FrameReader) -> Path:
    assert stage.facts is not None
    return stage.facts.show_directory
