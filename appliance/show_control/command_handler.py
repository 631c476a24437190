"""The desk: every command that came in, carried out here, in the show state, or by stage and projector."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from appliance.box.show_state import ShowState
from appliance.show_control.command import Command, command
from appliance.show_control.key_file import KeyFile
from appliance.show_control.order_dispatch import OrderDispatch, Then
from appliance.show_control.orders import Order, Place
from appliance.show_control.packet import Message, messages_in, readable
from appliance.show_control.port import Address
from appliance.show_control.sensor_roster import END as ROSTER_END
from appliance.show_control.sensor_roster import SENSOR, roster_messages
from appliance.show_control.show_state_commands import (
    CHANGES,
    PARTS,
    in_cue,
    known,
    let_go,
    next_cue,
    of_this_show,
)
from appliance.show_control.stage_observer import StageObserver
from appliance.show_control.standstill import Standstill
from appliance.show_control.status_messages import END, QUESTIONS, STATUS, Status, status, told

if TYPE_CHECKING:
    from appliance.outputs.shared_frame import Facts
    from appliance.sensor.keys import SensorKey

REPLY, SENSORS_REPLY, PONG = "/reply", "/sensors/reply", "/pong"
PHRASE_FADE_S = 2.0
# What a box sends is never answered: two boxes would go on answering each other for ever.
_ANSWERS = frozenset((REPLY, SENSORS_REPLY, PONG, END, STATUS, SENSOR, ROSTER_END))
_LISTED = ("/cues/", "/phrases/", "/looks/", "/hands/", "/fallbacks/")
_ONCE_A_BUNDLE = frozenset((*QUESTIONS, "/sensors/list", "/sensors/reload"))  # the same answer each time
_STREAMS = ("/player/", "/mocap/")  # answered only when refused, or when nobody carried them out
_BY_HAND = ("/player/start", "/player/stop", "/player/rate")
_NO_STAGE = "No stage dances on this box, so nothing is known of its sensors. Start it: bunraku play."

_ORDERS: Mapping[str, tuple[Place, str]] = {
    "/phrase": ("stage", "phrase"),
    "/iterations": ("stage", "iterations"),
    "/hold": ("stage", "hand"),
    "/player/start": ("stage", "start"),
    "/player/stop": ("stage", "stop"),
    "/player/jump": ("stage", "jump"),
    "/player/rate": ("stage", "rate"),
    "/player/excerpt": ("stage", "excerpt"),
    "/mocap/setjointrot": ("stage", "hold"),
    "/mocap/releasejoint": ("stage", "release"),
    "/sensors/neutral": ("stage", "neutral"),
    "/sensors/heading": ("stage", "heading"),
    "/sensors/strobe": ("stage", "strobe"),
    "/sensors/reload": ("stage", "reload"),
    "/projector/corner": ("projector", "corner"),
    "/projector/corners": ("projector", "corners"),
    "/projector/corners/reset": ("projector", "corners/reset"),
    "/projector/nudge": ("projector", "nudge"),
    "/projector/brightness": ("projector", "brightness"),
    "/projector/mirror": ("projector", "mirror"),
    "/projector/grid": ("projector", "grid"),
    "/projector/info": ("projector", "info"),
}


class _Undone(NamedTuple):
    """A cue that the stage of this generation did not do, as far as it said so."""

    cue: str
    generation: int
    then: Then


class CommandHandler:
    """`tell` sends a message to who asked; `publish` shows the show state to all who read it.

    refused: commands that were not carried out; reason: why the last one was not.
    """

    def __init__(
        self,
        show_state: ShowState,
        sight: StageObserver,
        errands: OrderDispatch,
        keys: KeyFile,
        tell: Callable[[Address, Message], None],
        publish: Callable[[ShowState], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.show_state = show_state
        self.refused = 0
        self.reason = ""
        self._sight, self._errands, self._keys = sight, errands, keys
        self._tell, self._publish, self._monotonic = tell, publish, monotonic
        self._standstill = Standstill(sight, errands)
        self._generation = -1
        self._is_new_stage = False
        self._began_in = ""  # the cue in which the newest stage began
        self._undone: _Undone | None = None  # the newest cue, if it was not done
        self._heard = 0
        self._set_by = dict.fromkeys(PARTS, 0)  # the newest command that has set it

    def hear(self, received: bytes, asker: Address, now: float) -> None:
        """Carry out what one datagram asks for; never raises, whatever it is."""
        try:
            messages = messages_in(received)
        except ValueError as error:
            self._end(asker, "", False, str(error))
            return
        once: set[str] = set()
        for address, arguments in messages:
            if address in _ANSWERS or address.startswith(_LISTED):
                self._refuse(f"{address} is an answer, no command.")
                continue
            try:
                if address in once:
                    raise ValueError(f"{address} came twice in a bundle: once is enough.")
                if address in _ONCE_A_BUNDLE:
                    once.add(address)
                self._carry_out(command(address, arguments), asker, now)
            except ValueError as error:
                self._end(asker, address, False, str(error))

    def look(self, now: float) -> None:
        """What has to be done without any command; call it often."""
        self._sight.state(now)
        facts = self._sight.facts
        if facts is not None and self._sight.generation != self._generation:
            self._generation = self._sight.generation
            self._set(of_this_show(self.show_state, facts))
            self._is_new_stage, self._began_in = True, ""
        if self._is_new_stage and facts is not None and (health := self._sight.health()):
            self._is_new_stage, self._began_in = False, str(health.get("cue", ""))
            self._come_back(facts, self._began_in, now)
        self._catch_up()
        self._standstill.look(self.show_state, now)

    def status(self, strangers: int, now: float) -> Status:
        """How the box is."""
        return status(self.show_state, self._sight, self.refused, strangers, now)

    def _come_back(self, facts: Facts, name: str, now: float) -> None:
        """After a power cut the stage goes on in its cue: so do picture and lights, if nobody said another.

        Its master stays aside: whoever switches the box on wants to see something.
        """
        cue = next((cue for cue in facts.cues if cue["name"] == name), None)
        if cue is not None and not self.show_state.cue:
            parts = [part for part in ("look", "lights") if not self._set_by[part]]
            self._set(in_cue(self.show_state, {**cue, "fade_s": 0.0}, parts, now))

    def _catch_up(self) -> None:
        """A stage that died before it answered had done its cue if the next one goes on in it."""
        undone = self._undone
        if undone is None or undone.generation == self._generation:
            return
        if undone.cue == self._began_in != self.show_state.cue:
            undone.then(True, "The stage was started anew in it.")

    def _carry_out(self, order: Command, asker: Address, now: float) -> None:
        """Raises ValueError for what cannot be done."""
        self._heard += 1
        address = order.address
        if address == "/ping":
            self._tell(asker, (PONG,))
        elif words := let_go(order):
            self._tell(asker, (REPLY, address, 0, words))  # not done, and nothing was refused
        elif address in CHANGES:
            self._change(order, asker, now)
        elif address in QUESTIONS:
            for message in told(address, self.show_state, self._sight, self.status(0, now), now):
                self._tell(asker, message)
        elif address == "/sensors/list":
            self._tell_roster(asker, now)
        elif address == "/cue":
            self._cue(order, asker, now)
        else:
            self._pass_on(order, asker, now)

    def _change(self, order: Command, asker: Address, now: float) -> None:
        show_state, words = CHANGES[order.address](self.show_state, order, self._sight.facts, now)
        if order.address == "/go":
            self._standstill.go(self.show_state, now)
        self._set(show_state)
        self._set_by |= {part: self._heard for part in PARTS if order.address == f"/{part}"}
        self._end(asker, order.address, True, words)

    def _cue(self, order: Command, asker: Address, now: float) -> None:
        """The stage first; then picture and lights follow, where nothing newer was said about them."""
        facts = self._sight.facts
        names = None if facts is None else [cue["name"] for cue in facts.cues]
        name = known("cue", order.text, names) if order.text else next_cue(self.show_state, facts)
        cue = next(cue for cue in facts.cues if cue["name"] == name) if facts else {}
        heard, generation = self._heard, self._generation

        def then(done: bool, words: str) -> None:
            self._undone = None if done else _Undone(name, generation, then)
            if done:
                parts = [part for part in PARTS if self._set_by[part] <= heard]
                self._set_by |= dict.fromkeys(parts, heard)
                self._set(in_cue(self.show_state, cue, parts, self._monotonic()))
            self._end(asker, "/cue", done, f"Cue {name}. {words}".rstrip() if done else words)

        self._errands.begin("stage", Order("cue", text=name), now, then)

    def _pass_on(self, command: Command, asker: Address, now: float) -> None:
        place, name = _ORDERS[command.address]
        values, text, keys = command.values, command.text, _no_keys()
        if command.address == "/phrase":
            text = known("phrase", text, self._sight.facts.phrases if self._sight.facts else None)
            values = values or (PHRASE_FADE_S,)
        elif command.address == "/sensors/reload":
            keys = self._keys.keys()
        elif command.address in _BY_HAND:
            self._standstill.leave()
        order = Order(name, values, text, keys, quiet=command.address.startswith(_STREAMS))
        self._errands.begin(place, order, now, partial(self._end, asker, command.address))

    def _tell_roster(self, asker: Address, now: float) -> None:
        if not self._sight.lives(now):
            raise ValueError(_NO_STAGE)
        key_file = str(self._keys.path or "")
        for message in roster_messages(self._sight.health(), key_file, now):
            self._tell(asker, message)

    def _set(self, show_state: ShowState) -> None:
        if show_state != self.show_state:
            self.show_state = show_state
            self._publish(show_state)

    def _end(self, asker: Address, address: str, done: bool, words: str) -> None:
        """Tell who asked what came of it."""
        if not done:
            self._refuse(words)
        reply = SENSORS_REPLY if address.startswith("/sensors/") else REPLY
        self._tell(asker, (reply, address, int(done), words or "Done."))

    def _refuse(self, reason: str) -> None:
        self.refused += 1
        self.reason = readable(reason)


def _no_keys() -> Mapping[str, SensorKey]:
    return {}
