"""The sound's process: shared frame and show state in, strings out through the sound card."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.box.fallback import Fallbacks
from appliance.box.own_process import OwnProcess
from appliance.box.realtime import share_the_interpreter, thread_priority
from appliance.box.show_state import ShowStateReader
from appliance.levers.fade import part_of_fade
from appliance.levers.show_state import ShowState
from appliance.levers.table import STRINGS
from appliance.outputs.frame_reader import FrameReader
from appliance.show.asked_for import no_sound
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.card import Card
from appliance.sound.couplings import Couplings
from appliance.sound.fallback import CARD_AWAY, DROPOUTS, NO_CARD, OF_THE_SOUND, STAGE_UNSEEN
from appliance.sound.instrument import Instrument

_log = logging.getLogger(__name__)

LOOK_S = 0.02  # how often show, cue and fades are looked at: each look holds up the card's thread
LOST_S = 0.5  # without a frame: as the projector
FADE_S = 0.5  # in which the strings then fade out
CHANGE_S = 0.1  # for the strings of one show to fall silent before those of another sound
_REPORT_S = 1.0


class Entrance:
    """How far the strings have come in, 0..1: into one of their cues and out of it over that cue's fade."""

    def __init__(self) -> None:
        self._cue: str | None = None
        self._from = self._to = 1.0
        self._since = self._fade_s = 0.0

    def share(self, cue: str, cues: Sequence[str], fades: Mapping[str, float], now: float) -> float:
        """cues: those in which they sound, [] all; fades: seconds of each cue's fade."""
        if cue != self._cue:
            is_first, here = self._cue is None, self._at(now)
            self._cue, self._to = cue, float(not cues or cue in cues)
            self._from, self._since = self._to if is_first else here, now
            self._fade_s = fades.get(cue, 0.0)
        return self._at(now)

    def _at(self, now: float) -> float:
        return self._from + (self._to - self._from) * part_of_fade(now, self._since, self._fade_s)


class Sound:
    """The strings of the show that the stage dances; another show gives other strings."""

    def __init__(
        self,
        config: SoundConfig,
        stage: FrameReader,
        show_state: ShowStateReader,
        fallbacks: Fallbacks,
    ) -> None:
        self.instrument: Instrument | None = None
        self._next: Instrument | None = None
        self._couplings: Couplings | None = None
        self._changes_at = 0.0  # when the next one takes its place
        self._config, self._stage, self._show_state = config, stage, show_state
        self._fallbacks = fallbacks
        self._strings, self._entrance = StringsConfig(), Entrance()
        self._fades: dict[str, float] = {}
        self._places: dict[str, int] = {}
        self._generation: int | None = None
        self._seen, self._seen_at = -1, 0.0  # the newest frame, and when it left the stage
        self._danced = -1
        self._trouble = ""

    def look(self, now: float) -> None:
        """Take the newest frame and the show state; monotonic seconds."""
        frame = self._stage.newest(now)
        if self._stage.generation != self._generation and self._stage.facts is not None:
            self._generation = self._stage.generation
            cues = self._stage.facts.cues
            self._fades = {str(cue["name"]): float(cue["fade_s"]) for cue in cues}
            self._places = {str(cue["name"]): place for place, cue in enumerate(cues)}
            self._begin(self._stage.facts.show_directory)
            self._changes_at = now if self.instrument is None else now + CHANGE_S
        if now >= self._changes_at:
            self.instrument = self._next
        elif self.instrument is not None:
            self.instrument.level = 0.0
            return
        if self.instrument is None:
            return
        if frame is not None and frame.tick != self._seen:
            self._seen, self._seen_at = frame.tick, frame.left
            if self._couplings is not None:
                self._couplings.look(frame)
        age_s = now - self._seen_at
        if age_s >= LOST_S:
            self.instrument.rest()
        self._fallbacks.set(STAGE_UNSEEN.name, age_s >= LOST_S)
        state = self._show_state.read()
        entered = self._entrance.share(state.cue, self._strings.cues, self._fades, now)
        loud = state.level(now) * state[STRINGS].level(now) * entered
        self.instrument.cue = self._places.get(state.cue, 0)
        self.instrument.level = loud * min(max(1.0 - (age_s - LOST_S) / FADE_S, 0.0), 1.0)

    def dance(self, stage: FrameReader, now: float) -> None:
        """Play to the newest frame. For the card's thread, right before each block: a frame that waited for
        `look` would be heard up to LOOK_S later. stage: a reader of that thread's own."""
        frame, facts, instrument = stage.newest(now), stage.facts, self.instrument
        if frame is None or facts is None or instrument is None or frame.tick == self._danced:
            return
        self._danced, puppet = frame.tick, facts.led_in(frame)
        if len(puppet.positions) != instrument.joints:  # the strings of this show have not come in yet
            return
        if instrument.of == "body":
            instrument.dance(puppet.positions, frame.frame_time)
        elif instrument.of == "couplings" and self._couplings is not None:
            instrument.couple(self._couplings.shares, frame.frame_time)
        elif instrument.of == "live" and frame.live.any():
            instrument.dance(frame.live, frame.frame_time)
        elif instrument.of == "hand" and frame.hands[:1].any():
            instrument.turn(frame.hands[0], frame.frame_time)
        else:
            instrument.rest()

    def render(self, frames: int, show_state: ShowState) -> NDArray[np.float32]:
        """The next samples (frames, channels): for the card's thread, which is late for nothing else. It also
        handles panic and blackout, with a separate reader: `look` may wait for a processor.
        """
        instrument = self.instrument
        if instrument is None:
            return np.zeros((frames, self._config.channels), np.float32)
        if show_state.panic or show_state.blackout:
            instrument.level = 0.0
        return instrument.render(frames)

    def report(self, card: Card, now: float) -> None:
        """Once a second: what has changed about the card."""
        self._fallbacks.follow(DROPOUTS.name, card.dropouts, now)
        self._fallbacks.concern(CARD_AWAY.name, filter(None, [card.name]))
        self._fallbacks.set(CARD_AWAY.name, "" if card.is_missing else card.trouble)
        self._fallbacks.set(NO_CARD.name, card.is_missing)
        if card.refused:
            _log.warning(
                f"No real-time priority for the sound ({card.refused}). The strings sound; on a busy "
                "machine one block in a hundred came 9 ms late instead of 1, and crackled. Allow it with "
                "LimitRTPRIO= in the unit."
            )
            card.refused = ""
        if card.trouble != self._trouble:
            self._trouble = card.trouble
            if card.trouble:
                _log.warning(card.trouble)
            else:
                _log.info("The sound card is back, and the strings sound.")

    def _begin(self, directory: Path) -> None:
        self._couplings = None
        try:
            show = load_show(directory)
        except ConfigError as error:
            _log.error(f"{error}\nThe strings stay silent until the stage dances another show.")
            self._next = None
            return
        strings = show.config.strings
        self._next = None if strings is None else Instrument(show.skeleton, strings, self._config)
        self._strings = strings or StringsConfig()
        if self._strings.of == "couplings":
            self._couplings = Couplings(show.skeleton)
        name = show.config.name
        count = 0 if self._next is None else len(self._next.strings.bones)
        _log.info(f"{name}: {count} strings." if count else f"{name} has no `strings:`, and is silent.")


def require_sound(box: BoxConfig) -> SoundConfig:
    """The box's sound. Raises NotAskedForError where the box file wants none."""
    if box.sound is None:
        raise no_sound(box.path)
    return box.sound


def run_sound(box_file: Path | None, by_hand: bool = True) -> None:
    """Play the strings of the show that the stage dances, until a signal comes.

    by_hand: without a box file the system's own sound card is meant.

    Raises NotAskedForError, RuntimeFolderError.
    """
    box = load_box(box_file)
    config = SoundConfig() if by_hand and box_file is None else require_sound(box)
    with OwnProcess(box, "sound", OF_THE_SOUND) as own:
        stage, danced = own.keep(FrameReader(own.folder)), own.keep(FrameReader(own.folder))
        show_state, for_the_card = (own.keep(ShowStateReader(own.folder)) for _ in range(2))
        sound = Sound(config, stage, show_state, own.fallbacks)
        priority = (
            max(box.realtime.priority // 2, 1) if box.realtime.enabled else None
        )  # the dance goes first

        def render(frames: int) -> NDArray[np.float32]:
            sound.dance(danced, time.monotonic())
            return sound.render(frames, for_the_card.read())

        card = own.keep(Card(config, render, priority))
        share_the_interpreter()
        if priority is not None:
            thread_priority(1)  # this thread, held up with the interpreter in hand, would hold up the card's
        own.notifier.ready("The strings follow the stage.")
        report_at = 0.0
        while not own.stopped():
            now = time.monotonic()
            sound.look(now)
            if sound.instrument is not None:
                card.look(now)
            own.pulse(now)
            if now >= report_at:
                report_at = now + _REPORT_S
                sound.report(card, now)
            time.sleep(LOOK_S)
