"""A stage that is one of two: what it tells the other box of each tick, and how it follows that one's."""

from __future__ import annotations

import hashlib
import json
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from appliance.box.clock import TICK_S, TickClock
from appliance.box.fallback import Fallbacks
from appliance.box.log import Trouble
from appliance.box.orders import Order
from appliance.box.snapshot import packed, restore, shift_times
from appliance.dancer.loop import Loop
from appliance.levers import show_state as states
from appliance.levers.show_state import ShowState
from appliance.pair.carrier import Carrier, receivers_of
from appliance.pair.pair import Pair, PairSettings
from appliance.pair.part import BoxPart, PartWriter
from appliance.pair.roles import Role
from appliance.recorder.record import DAMAGED, EVENT, ORDER, TICK, facts_of_run, layout_of
from appliance.sensor.wire import KEY_BYTES
from appliance.show.box import OutputsConfig
from appliance.show.config_error import ConfigError, Problem
from appliance.show.pair import PairConfig
from appliance.show.show import Show
from appliance.stage.comparison import Comparison
from appliance.stage.fallback import PAIR_ALONE, PAIR_TAKEN
from appliance.stage.made_again import maker_of
from appliance.stage.reconcile import Reconciler
from appliance.stage.rerun import RecordedNetwork, Rerun
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.stage_parts import StageParts
from appliance.stage.tick import Tick

STATE, ROUTES = 16, 17  # kinds of items beside the journal's
_ITEM = struct.Struct("<BI")
_PLACE = struct.Struct("<qd")  # tick and deadline before a keyframe
_EACH_TICKS = 50  # show state and routes, also unchanged
_AT_ONCE = 3  # ticks that a follower runs before it looks at the network again
_REST_S = 0.001  # between as many, when it is far behind: others need the processor too
_MOST_BEHIND = 25  # messages, so some 0.5 s: a jump that far is better than no dance
_CALL_EACH_S, _CALLS_FOR_S = 0.25, 3.0  # after that a wearable greets by itself
_OWN_STATE_S = 0.5  # since its last frame: a deposed leader may take the lead back from where it stood
_FRESH_LOOK_S = 0.004
_LATE_S = TICK_S / 2.0  # a frame that left later counts from when it left: its box was held up, and lives
_GIVE_EACH_S = 1.0
_OTHERS = frozenset(("run", "pid", "show_directory", "python", "numpy", "onnxruntime"))
TOLERANCE_DEGREES = 0.5  # between processors of two kinds; beyond it the leader's state is fetched again


def settings_of(config: PairConfig) -> PairSettings:
    """From the box file. Raises ConfigError for a missing or malformed secret."""
    key = secret_in(config.secret)
    return PairSettings(
        name="the second box" if config.role == "first" else "the first box",
        is_first=config.role == "first",
        host=config.host,
        port=config.port,
        peers=tuple(config.peer),
        key=key,
        silent_s=config.silent_ms / 1000.0,
    )


def secret_in(path: Path) -> bytes:
    """The secret of a pair, or of boxes in step. Raises ConfigError where it is missing or malformed."""
    try:
        key = bytes.fromhex(path.read_text().strip())
    except (OSError, ValueError):
        key = b""
    if len(key) != KEY_BYTES:
        words = f"There is no pair's secret in {path}."
        cure = f"Make it: bunraku pair secret {path}; and copy it to the other box."
        raise ConfigError([Problem(path, 0, words, cure)])
    return key


def fingerprint_of(show: Show, facts: dict[str, Any]) -> bytes:
    """A digest of all that both need alike to dance alike: show file, network, phrases, layout of a tick."""
    digest = hashlib.blake2s(digest_size=8)
    digest.update(json.dumps({name: facts[name] for name in sorted(facts.keys() - _OTHERS)}).encode())
    for path in (show.file.path, show.network, *dict.fromkeys(show.phrases.values())):
        digest.update(Path(path).read_bytes())
    return digest.digest()


@dataclass(frozen=True, slots=True, kw_only=True)
class PairParts:
    """The parts of a stage that its pair works with.

    folder: where this box's part in the pair is published. note: logs a sentence, and notes it in the
    journal. made: gives the loops that this box's generator has made, and raises ValueError for others; None:
    there is no generator.
    """

    outputs: OutputsConfig
    show: Show
    parts: StageParts
    wearing: SensorFit
    tick: Tick
    reconciler: Reconciler
    folder: Path
    note: Callable[[str], None]
    made: Callable[[str], Loop] | None = None


class PairedStage:
    """Joins the pair with the stage's parts. Nothing here waits but `follow`.

    tick: the stage's; its parts hear the sensors while this box leads, and the other box otherwise.
    differs: the worst difference of a frame from the leader's, degrees, since it was followed.
    """

    def __init__(self, config: PairConfig, stage: PairParts) -> None:
        show, parts, tick = stage.show, stage.parts, stage.tick
        facts = facts_of_run(show, list(parts.worn))
        self._layout = layout_of(facts)
        self._settings = settings_of(config)
        self.pair = self._open(fingerprint_of(show, facts), time.monotonic())
        self._parts, self._tick = parts, tick
        self._wearing, self._reconciler = stage.wearing, stage.reconciler
        self._log_and_note = stage.note
        self._rerun = Rerun(tick, stage.wearing, facts["sensors"])
        self._own_link, self._own_live = parts.link, parts.live_inbox
        self._own_latest_start_s = tick.latest_start_s
        self._own_most = [one.iterations.most for one in parts.puppets]
        if stage.made is not None:
            parts.make_by(_made_here_or_again(show, parts, stage.made))
        self._part = PartWriter(stage.folder)
        self._carrier = Carrier(receivers_of(stage.outputs), peers=self._settings.peers)
        self._give_at = float("-inf")
        self._items: list[bytes] = []
        self._sent_state: ShowState | None = None
        self._state_due = 0
        self._applied = 0
        self._routes: dict[str, Any] = {}
        self._has_danced = False  # some tick of the leader was followed
        self._last = 0, 0.0  # tick, deadline of the newest one that was followed
        self._comparison = Comparison(0.0, TOLERANCE_DEGREES)
        self._role = self.pair.roles.role
        self._spoke_at = self._took_over_at = self._call_at = float("-inf")
        self._looked_at = self._beat_at = 0.0
        self.resyncs = 0
        self._hear_leader()

    def _open(self, fingerprint: bytes, now: float) -> Pair:
        return Pair(self._settings, fingerprint, now)

    @property
    def leads(self) -> bool:
        """Whether this box speaks."""
        return self.pair.leads

    @property
    def ahead_s(self) -> float:
        """How far this machine's clock is ahead of the other box's."""
        return self.pair.offset.seconds

    def note(self, kind: int, noted: bytes) -> None:
        """The recorder's tap: what the other box needs of it."""
        if self.pair.leads and (kind == TICK or (kind == EVENT and b'"kind": "order"' in noted[:64])):
            self._items.append(_ITEM.pack(kind, len(noted)) + noted)

    def publish(self, now: float) -> None:
        """The leader, right after its frame left: the tick, and what happened before it."""
        if not self.pair.leads:
            self._items.clear()
            return
        self._state_due -= 1
        state = self._reconciler.declared
        if state is not self._sent_state or self._state_due <= 0:
            self._sent_state, self._state_due = state, _EACH_TICKS
            said = struct.pack("<q", self._reconciler.generation) + states.packed(state)
            self._items.append(_ITEM.pack(STATE, len(said)) + said)
            routes = json.dumps(self._own_link.heard_at(now)).encode()
            self._items.append(_ITEM.pack(ROUTES, len(routes)) + routes)
        self.flush(now)
        self._call_sensors(now)
        if self.pair.wants_keyframe:
            frame = self._tick.frame
            self.pair.give_keyframe(_PLACE.pack(frame.tick, frame.frame_time) + packed(self._tick))
        self.pair.answer(now)
        self._write_part(now)

    def flush(self, now: float) -> None:
        """Send what has gathered."""
        self.pair.newest_frame = max(self._tick.frame.frame_time, now - _LATE_S)
        if self._items:
            self.pair.publish(b"".join(self._items), now)
            self._items.clear()

    def begin(self, now: float) -> None:
        """The box is ready to hear the other one."""
        self.pair.roles.begin(now)
        name, peers = self._settings.name, self._settings.peers
        if self._carrier.is_apart(peers):
            self._log_and_note(
                Trouble(
                    f"{name.capitalize()} ({' and '.join(peers)}) is in no network of the outputs: if the "
                    "link fails, both send. Give its address in the outputs' network as the first `peer:`."
                )
            )

    def still_leads(self, now: float) -> bool:
        """The leader, before a tick: whether it still leads."""
        self._look(now)
        if self.pair.leads:
            self._begin_tick(now)
        return self.pair.leads

    def follow(self, clock: TickClock, pulse: Callable[[float, float], None]) -> None:
        """One pass of a box that does not lead: run what has come; take over where it is time.

        pulse: called after each tick with the time and the cost of the tick in ms.
        """
        self.pair.await_datagram(0.004 if self.pair.is_ready else 0.01)
        now = clock.now()
        self._look_at_cable(now)
        self._look(now)
        if self.pair.leads:
            for message in self.pair.take_rest():
                self._run(message, clock, pulse)
            self._take_over(clock)
            return
        if now - self._beat_at >= TICK_S:
            self._beat_at = now
            self.pair.beat(now)
            self._own_link.overhear(now)
            self._write_part(now)
        self.pair.ask(now)
        if not self.pair.same_show:
            return
        if (keyframe := self.pair.take_keyframe()) is not None:
            self._restore(keyframe)
        for _ in range(_AT_ONCE):
            if (next_one := self.pair.take_message()) is None:
                break
            self._run(next_one, clock, pulse)
        else:
            time.sleep(_REST_S)
        follows = self._has_danced and self.pair.behind <= _MOST_BEHIND
        own = now - self._spoke_at < _OWN_STATE_S
        self.pair.is_ready = (follows or own) and not self._carrier.is_out

    def give_back(self, now: float) -> tuple[bool, str]:
        """Let the other box lead; whether it was asked to, and a sentence."""
        if not self.pair.leads:
            return False, "This box follows already; ask the one that leads."
        if not self.pair.roles.give_back(now):
            return False, f"{self._settings.name.capitalize()} is not there, or not ready to take over."
        self.pair.beat(now)
        return True, f"{self._settings.name.capitalize()} leads from the next frame on."

    def refused(self, order: Order) -> str:
        """Why a box that follows does not carry it out."""
        return f"This box follows {self._settings.name}: send it there ({order.name})."

    def reported(self, now: float) -> dict[str, Any]:
        """For status and page."""
        roles, worst = self.pair.roles, self._comparison.worst
        pair = {
            "box": "first" if self._settings.is_first else "second",
            "role": roles.role.name.lower(),
            "peer": roles.peer_lives(now),
            "ready": self.pair.is_ready if not roles.leads else bool(roles.peer and roles.peer.is_ready),
            "epoch": roles.epoch,
            "takeovers": roles.takeovers,
            "why": roles.why,
            "same_show": self.pair.same_show,
            "differs_degrees": 0.0 if worst is None else worst.degrees,
            "resyncs": self.resyncs,
        }
        return {"pair": pair}

    def set_fallbacks(self, fallbacks: Fallbacks, now: float) -> None:
        """Once a second: whether nobody could take over, and how often this box did."""
        fallbacks.set(PAIR_ALONE.name, self.complaint(now))
        fallbacks.follow(PAIR_TAKEN.name, self.pair.roles.takeovers, now)

    def complaint(self, now: float) -> str:
        """Why nobody could take over, or ""."""
        name, roles = self._settings.name, self.pair.roles
        if self.pair.trouble:
            return f"The pair's port cannot be opened ({self.pair.trouble}): no box takes over. Free it."
        if self.pair.has_other_secret:
            return (
                f"{name.capitalize()} of the pair has another secret: it cannot follow. Copy the file to it."
            )
        if roles.leads and not self._carrier.may_speak(now, roles.heard):
            return (
                "This box sends nothing: its cable to the receivers is out, or came back before "
                f"{name} was heard again, which leads if it can. Plug it in, and wait for up to 32 s."
            )
        if not roles.peer_lives(now):
            return (
                f"{name.capitalize()} of the pair is not heard: the show goes on, and nobody would take "
                "over. Switch it on; look at the cable between, and at pair: in both box files."
            )
        if not self.pair.same_show:
            return (
                f"{name.capitalize()} has another show or another release: it cannot follow. Give both "
                "the same."
            )
        return ""

    def close(self) -> None:
        self.pair.close()
        self._part.close()

    def _look(self, now: float) -> None:
        self._looked_at = now
        before = self._role
        self.pair.look(now)
        self._role = role = self.pair.roles.role
        if before is role:
            return
        self._log_and_note(self._sentence(role))
        if before is Role.LEADS:
            self._has_danced = False
            self._hear_leader()
        self._write_part(now)

    def _sentence(self, role: Role) -> str:
        """The new part of this box and the reason for it, for people and the journal."""
        roles, name = self.pair.roles, self._settings.name
        if role is Role.LEADS:
            return f"This box leads the pair from now on ({roles.why}; change {roles.epoch})."
        if role is Role.FOLLOWS:
            return f"This box follows {name}, its outputs silent ({roles.why}; change {roles.epoch})."
        return f"This box gives the lead to {name}."

    def _speaks_until(self) -> float:
        """Right before a frame leaves: a box that was held up may have lost the lead meanwhile, and one that
        is held up from now on may lose it as soon as the other one takes it for silent.
        """
        if not self.pair.leads:
            return _never()
        now = time.monotonic()
        self._look_at_cable(now)
        if now - self._looked_at > _FRESH_LOOK_S:
            self._look(now)
        if not self.pair.leads or not self._carrier.may_speak(now, self.pair.roles.heard):
            return _never()
        return max(self.pair.newest_frame + self._settings.silent_s, now + _FRESH_LOOK_S)

    def _look_at_cable(self, now: float) -> None:
        """A leader whose own cable is out gives the lead away, where another link still joins the two."""
        carrier, roles = self._carrier, self.pair.roles
        carrier.look(now)
        self.pair.reaches = carrier.reaches(roles.role, now, roles.heard)
        if (
            roles.leads
            and now >= self._give_at
            and carrier.is_heard_nonetheless(now, self.pair.came_after, self.pair.heard_from)
        ):
            self._give_at = now + _GIVE_EACH_S
            self.give_back(now)

    def _begin_tick(self, now: float) -> None:
        """Before a frame that may wait for a reading: that this box is there, and leads."""
        self.pair.beat(now)

    def _write_part(self, now: float) -> None:
        roles = self.pair.roles
        if speaks := roles.leads and self._carrier.may_speak(now, roles.heard):
            self._spoke_at = now
        self._part.write(
            BoxPart(
                leads=roles.leads,
                speaks=speaks,
                is_ready=self.pair.is_ready,
                peer_lives=roles.peer_lives(now),
                epoch=roles.epoch,
                written=now,
            )
        )

    def _hear_leader(self) -> None:
        parts = self._parts
        parts.link, parts.live_inbox = self._rerun.heard, self._rerun.live
        parts.outputs.speaks_until = _never  # also while a box that takes over runs the leader's last ticks
        parts.outputs.shift_s = self.pair.offset.seconds

    def _restore(self, keyframe: bytes) -> None:
        try:
            self._last = _PLACE.unpack_from(keyframe)
            restore(self._tick, keyframe[_PLACE.size :])
        except DAMAGED as error:
            self._lose_step(f"The leader's state does not fit here ({type(error).__name__}: {error}).")
            return
        self._has_danced, self._spoke_at = True, float("-inf")
        self._comparison = Comparison(0.0, TOLERANCE_DEGREES)

    def _run(self, message: bytes, clock: TickClock, pulse: Callable[[float, float], None]) -> None:
        """The items of a message in their order."""
        for kind, item in _items_of(message):
            try:
                if kind == TICK:
                    self._run_tick(item, clock, pulse)
                elif kind == EVENT:
                    event = json.loads(item)
                    if event["kind"] == ORDER:
                        order, done_then, done = self._rerun.obey(event)
                        self._comparison.note_order(order.name, done_then, done)
                elif kind == STATE:
                    self._take_state(item)
                elif kind == ROUTES:
                    self._routes = json.loads(item)
            except DAMAGED as error:
                self._lose_step(
                    f"A message of the leader does not fit here ({type(error).__name__}: {error})."
                )
                return

    def _run_tick(self, item: bytes, clock: TickClock, pulse: Callable[[float, float], None]) -> None:
        recorded = np.frombuffer(item, self._layout, 1)[0]
        begun = clock.now()
        self._parts.outputs.shift_s = self.pair.offset.seconds
        slot = self._rerun.dance(recorded)
        self._last, self._has_danced = (slot.tick, slot.deadline), True
        self._comparison.look(recorded, self._tick)
        now = clock.now()
        pulse(now, 1000.0 * (now - begun))
        if (first := self._comparison.first) is not None:
            self._comparison = Comparison(0.0, TOLERANCE_DEGREES)
            self._lose_step(f"This box danced otherwise than the leader: {first.sentence()}")

    def _lose_step(self, why: str) -> None:
        self.resyncs += 1
        self.pair.forget_state()
        if self.resyncs < 10 or self.resyncs % 100 == 0:
            self._log_and_note(Trouble(f"{why} The leader's state is fetched again."))

    def _take_state(self, item: bytes) -> None:
        (self._applied,) = struct.unpack_from("<q", item)
        state, ahead_s = states.unpacked(item[8:]), self.pair.offset.seconds
        settings = {name: replace(one, since=one.since + ahead_s) for name, one in state.settings.items()}
        self._part.write_state(replace(state, settings=settings))

    def _call_sensors(self, now: float) -> None:
        """Ask the wearables that the other box had to greet this one, until they do: they go on streaming
        meanwhile, to nobody.
        """
        if now < self._call_at or now - self._took_over_at > _CALLS_FOR_S:
            return
        self._call_at = now + _CALL_EACH_S
        for name, (boot_nonce, host, port) in self._routes.items():
            if (self._own_link.newest_arrival(name) or float("-inf")) < self._took_over_at:
                self._own_link.call(name, boot_nonce, (host, port))

    def _take_over(self, clock: TickClock) -> None:
        """From the next slot on this box speaks."""
        parts, ahead_s = self._parts, self.pair.offset.seconds
        self.pair.lead_anew()
        self.pair.is_ready = True
        parts.link, parts.live_inbox = self._own_link, self._own_live
        parts.outputs.speaks_until = self._speaks_until
        parts.outputs.shift_s = 0.0
        self._sent_state = None
        if self._has_danced:
            shift_times(self._tick, ahead_s)
            tick, deadline = self._last
            clock.go_on(tick, deadline + ahead_s)
            now = clock.now()
            self._took_over_at = self._call_at = now
            self._call_sensors(now)  # they leave behind the first frame: a datagram's way may hold it up
            self._reconciler.go_on_after(self._applied, now)
        else:
            clock.begin(0.001)
        self._tick.latest_start_s = self._own_latest_start_s
        if isinstance(parts.network, RecordedNetwork):
            parts.network.fails = ()
        for one, most in zip(parts.puppets, self._own_most, strict=True):
            if most < one.iterations.most:
                one.iterations.allow(most)
        self._has_danced = False
        self._write_part(clock.now())


def _never() -> float:
    return float("-inf")


def _made_here_or_again(show: Show, parts: StageParts, made: Callable[[str], Loop]) -> Callable[[str], Loop]:
    """Loops of recipes: those of this box's generator, else made again as a replay does."""
    again = maker_of(show, parts.led.motion)

    def loop(recipe: str) -> Loop:
        try:
            return made(recipe)
        except ValueError:
            return again(recipe)

    return loop


def _items_of(message: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + _ITEM.size <= len(message):
        kind, length = _ITEM.unpack_from(message, at)
        at += _ITEM.size
        yield kind, message[at : at + length]
        at += length
