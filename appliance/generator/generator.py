"""The generator of a show: makes what its puppets start from, and the next of it before it is needed."""

from __future__ import annotations

import contextlib
import ctypes
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appliance.box.fallback import Fallbacks
from appliance.box.made_motion import FOLDER, MadeMotion, MadeMotionWriter, SavedNamesWriter
from appliance.box.mounts import disk_of
from appliance.box.orders import Order
from appliance.box.show_state import ShowStateReader
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
from appliance.generator.fallback import NOT_MADE, NOT_SAVED
from appliance.generator.request import AGAIN_SEEDS, Request, Requests
from appliance.generator.saved_motions import SavedMotions
from appliance.levers.show_state import ShowState
from appliance.levers.sources import IMPROVISE, KEPT, MAIN
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import PuppetFrame
from appliance.pose import quaternion
from appliance.pose.bvh import BvhError
from appliance.pose.skeleton import Skeleton
from appliance.show.box import BoxConfig
from appliance.show.puppets import PuppetStart
from appliance.show.show import Show

HELD = 0.5  # a hand with less weight is ignored
STEADY = 0.03  # fraction of the map: a limb that trembles by less stays where it pointed

_TAKEN_S = 5.0  # a motion for now that no stage has taken over by then is made again
_REST_S = 0.2  # from one motion to the next, at least
_AHEAD_S = 1.2  # until an improvisation is made that is wanted at once
_FILES = 3  # each puppet's newest besides the one that dances: the stage may still open the one before
_EACH = ("seed", "number", "after", "from_s", "prompt")
_M_MMAP_THRESHOLD, _ARRAY_BYTES = -3, 1 << 17  # from malloc.h; it grows by itself unless it is set
_MOST_NUMBERS = 10_000_000  # exact in the track's float32
_WRONG = (MotionNetworkError, GroundingError, PhraseError, BvhError, OSError, LookupError, ValueError)


@dataclass
class _Ahead:
    """Motion made ahead for one puppet. request: the one for the last motion; returns: since then."""

    puppet: PuppetStart
    writer: MadeMotionWriter
    request: Request | None = None
    recipe: str = ""
    returns: int = 0
    rests_until: float = 0.0
    taken_by: float = math.inf
    complaint: str = ""


class Generator:
    """Makes one show's motion. Raises OSError where the runtime folder takes no file."""

    def __init__(
        self, show: Show, box: BoxConfig, folder: Path, stage: FrameReader, fallbacks: Fallbacks
    ) -> None:
        config = show.config
        self._show, self._folder, self._stage, self._fallbacks = show, folder, stage, fallbacks
        self._requests = Requests(config)
        self._phrases = PhraseCache(show.directory, folder / MEMORY)
        self._loops: dict[str, Loop] = {}
        grounded = config.motion.grounded
        self._maker = Maker(show.skeleton, show.motion_networks, self._loop_of, grounded)
        taken = tuple(name for name in config.motion.sources if name not in config.motion.kept)
        self.saved = SavedMotions(folder, box.state_folder, show.skeleton.names, taken)
        hand = (
            config.hands[0].joint
            if config.motion.path and config.motion.path.by_hand and config.hands
            else ""
        )
        self._pointing = Pointing(show.skeleton, hand) if hand else None
        self._pointed: list[float] = []
        self._state, self._disk = box.state_folder, ""
        self._saved_names = SavedNamesWriter(folder)
        self._published_names: list[str] | None = None
        self._ahead = [_Ahead(puppet, MadeMotionWriter(folder, puppet.number)) for puppet in config.cast]
        self._number = 1000 + int(time.time()) % _MOST_NUMBERS

    def look(self, state_reader: ShowStateReader, now: float) -> bool:
        """Make what is wanted next, if anything is; whether it did."""
        if (names := sorted(self.saved.recipes)) != self._published_names:
            self._published_names = names
            self._saved_names.write(names)
        if self.saved.complaint and self._state is not None and not self._disk:
            self._disk = disk_of(self._state)
            self._fallbacks.concern(NOT_SAVED.name, filter(None, [self._disk]))
        self._fallbacks.set(NOT_SAVED.name, self.saved.complaint)
        state = state_reader.read()
        if self._pointing is not None:
            frame, facts = self._stage.newest(now), self._stage.facts
            self._pointed = self._pointing.point(facts.led_in(frame) if facts and frame else None)
        waiting_first = sorted(self._ahead, key=lambda one: one.request is not None)
        return any(self._look_at(one, state, now) for one in waiting_first)  # one motion, then it looks again

    def obey(self, order: Order) -> tuple[bool, str]:
        """Carry out an order of show control's: keep."""
        if order.name != "keep":
            return False, f"The generator knows no order '{order.name}'."
        danced = self._danced(self._show.config.led)
        try:
            if not danced:
                raise ValueError("The motion that dances now was not made ahead: there is nothing to keep.")
            number = parsed_recipe(danced)["number"]
            return True, self.saved.keep(order.text, self._file(number))
        except (ValueError, LookupError) as error:
            return False, str(error)

    def close(self) -> None:
        """Release the files; what was made stays."""
        self._saved_names.close()
        for one in self._ahead:
            one.writer.close()

    def _look_at(self, ahead: _Ahead, state: ShowState, now: float) -> bool:
        """Make what is wanted next for a puppet, if anything is; whether it did."""
        reported, danced = self._reported(ahead.puppet), self._danced(ahead.puppet)
        base, wanted = str(reported.get("base", MAIN)), str(reported.get("wanted", ""))
        request = self._requests.request(
            state, base, self.saved.recipes, now, wanted, ahead.puppet, self._pointed
        )
        if request is None:
            ahead.request = None
            return False
        self._adopt(ahead, request, danced)
        is_used = bool(ahead.recipe) and danced == ahead.recipe
        if request != ahead.request and now < ahead.rests_until:
            return False  # a hand draws over the map: the newest point counts
        is_unseen = not is_used and now > ahead.taken_by
        if request != ahead.request:
            ahead.returns = 0
        elif is_used and request.is_new_at_return:
            ahead.returns += 1
        elif not is_unseen:
            return False
        at_once = request != ahead.request or is_unseen
        ahead.rests_until, ahead.taken_by = now + _REST_S, now + _TAKEN_S if at_once else math.inf
        self._make(ahead, request, at_once)
        ahead.request = request
        return True

    def _reported(self, puppet: PuppetStart) -> Mapping[str, Any]:
        """The stage's report on a puppet."""
        health = self._stage.health() or {}
        found = (one for one in health.get("puppets", ()) if one.get("name") == puppet.name)
        return next(({**health, **one} for one in found), {})

    def _danced(self, puppet: PuppetStart) -> str:
        """The recipe that a puppet dances; "" for none."""
        return str(self._reported(puppet).get("made", ""))

    def _adopt(self, ahead: _Ahead, request: Request, danced: str) -> None:
        """After a restart: the present motion was made for this request; the next follows at its return."""
        if ahead.request is not None or not danced:
            return
        recipe, own = parsed_recipe(danced), request.recipe
        returns = recipe.get("seed", 0) - own.get("seed", 0)
        if _character(recipe) == _character(own) and 0 <= returns < AGAIN_SEEDS:
            ahead.request, ahead.recipe, ahead.returns = request, danced, returns

    def _make(self, ahead: _Ahead, request: Request, at_once: bool) -> None:
        """Make a motion and hand it over; a failure is reported, and tried again at the next request."""
        self._number = 1000 + (self._number + 1) % _MOST_NUMBERS
        recipe = {**request.recipe, "number": self._number}
        if "seed" in recipe:
            recipe["seed"] += ahead.returns
        try:
            if recipe["source"] == IMPROVISE:
                recipe |= self._going_on(ahead.puppet, at_once)
            text, file = recipe_text(recipe), self._file(self._number)
            loop = self._numbered(request.name) if recipe["source"] == KEPT else self._maker.make(recipe)
            write_material(file, Material(text, loop), self._show.skeleton.names)
            ahead.writer.write(MadeMotion(text, file.name, request.name, at_once, recipe.get("from_s")))
        except _WRONG as error:
            ahead.complaint = f"{request.name}: {error} The last phrase plays on."
            self._fallbacks.concern(NOT_MADE.name, [request.name])
        else:
            ahead.complaint, ahead.recipe = "", text
            give_back_memory()
            self._forget_old()
        complaints = dict.fromkeys(one.complaint for one in self._ahead if one.complaint)
        self._fallbacks.set(NOT_MADE.name, " ".join(complaints))

    def _going_on(self, puppet: PuppetStart, at_once: bool) -> dict[str, Any]:
        """The pose that an improvisation continues: one that is soon danced, or the end of another one."""
        reported, danced = self._reported(puppet), self._danced(puppet)
        name = str(reported.get("base", MAIN))
        if danced:
            number = int(parsed_recipe(danced)["number"])
            loop = read_material(self._file(number), self._show.skeleton.names).loop
        else:
            number, loop = [*self._show.phrases].index(name), self._loop_of(name)
        frame = float(end_of(loop))
        if at_once:
            reported_at = float(reported.get("looked_at", time.monotonic()))
            ahead_s = _AHEAD_S + time.monotonic() - reported_at
            frame = round((float(reported.get("position_s", 0.0)) + ahead_s - loop.start_s) * FPS)
            frame = frame % loop.period
        network = self._maker.network(IMPROVISE)
        prompt = prompt_of(loop, frame, self._show.skeleton, network, network.places)
        return {"after": number, "from_s": round(loop.start_s + frame / FPS, 2), "prompt": prompt}

    def _numbered(self, name: str) -> Loop:
        """A kept motion under the number of now."""
        loop = self.saved.material(name).loop
        track = loop.track.copy()
        track[:, NUMBER] = self._number
        return Loop.made(loop.poses, track, loop.step, loop.start_s)

    def _file(self, number: int) -> Path:
        return self._folder / FOLDER / f"{number}{SUFFIX}"

    def _forget_old(self) -> None:
        recipes = [parsed_recipe(text) for one in self._ahead if (text := self._danced(one.puppet))]
        files = {*(self._folder / FOLDER).glob(f"*{SUFFIX}")}
        files -= {self._file(recipe["number"]) for recipe in recipes}
        for file in sorted(files, key=lambda file: file.stat().st_mtime_ns)[: -_FILES * len(self._ahead)]:
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
    """The properties shared by all motions that are made for one request."""
    return {name: value for name, value in recipe.items() if name not in _EACH}


def save_memory() -> None:
    """Arrays go back to the system as soon as they are freed: 10 to 20 MB less while motion is made."""
    with contextlib.suppress(OSError, AttributeError):  # not the GNU C library
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _ARRAY_BYTES)


def give_back_memory() -> None:
    """Returns memory freed by numpy and onnxruntime to the system: 20 MB of 130."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


class Pointing:
    """Reads the frames of a puppet. joint: the name of the one that the hand holds."""

    def __init__(self, skeleton: Skeleton, joint: str) -> None:
        self._joint = skeleton.index(joint)
        below = [child for child, parent in enumerate(skeleton.parents) if parent == self._joint]
        limb = np.asarray(skeleton.offsets[below[0]] if below else (0.0, 0.0, 1.0), np.float32)
        self._limb = limb / max(float(np.linalg.norm(limb)), 1e-6)
        self._point: list[float] = []

    def point(self, frame: PuppetFrame | None) -> list[float]:
        """x, y, each 0 to 1, as `/motion/path` takes them; [] while the hand does not hold.

        Depends only on the joint's rotation, seen from the front of the parent joint: ahead is the middle;
        left and right, up and down are the edges. Angles would leap where a limb hangs.
        """
        if frame is None or frame.holds[self._joint] < HELD:
            self._point = []
            return self._point
        x, y, _ = quaternion.rotate(frame.pose[self._joint], self._limb).tolist()
        found = [round(min(max(0.5 + share / 2, 0.0), 1.0), 2) for share in (x, y)]
        if not self._point or math.dist(found, self._point) > STEADY:
            self._point = found
        return self._point
