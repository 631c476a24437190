"""The command handler: every command becomes a declaration in the show state, an order or an answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from appliance.box.show_state import ShowState
from appliance.show.sources import LIVE
from appliance.show_control.acknowledgements import Acknowledgements
from appliance.show_control.command import (
    LONGEST_NAME,
    PONG,
    REPLY,
    SENSORS_REPLY,
    STREAMS,
    Command,
    command,
)
from appliance.show_control.fallback import COMMAND_FAILED, LIVE_PARTIAL, LIVE_REFUSED
from appliance.show_control.key_file import KeyFile
from appliance.show_control.live_input import LiveInput, is_live
from appliance.show_control.names_of_show import joint_name
from appliance.show_control.order_dispatch import OrderDispatch
from appliance.show_control.orders import Order, Place
from appliance.show_control.packet import Message, messages_in, readable
from appliance.show_control.port import Address
from appliance.show_control.sensor_roster import END as ROSTER_END
from appliance.show_control.sensor_roster import SENSOR, roster_messages
from appliance.show_control.show_state_commands import (
    DECLARATIONS,
    SHOWS_RATE,
    in_cue,
    let_go,
    of_this_show,
)
from appliance.show_control.stage_observer import StageObserver
from appliance.show_control.status_messages import END, QUESTIONS, STATUS, Status, status, told
from appliance.show_control.trackers import TRACKERS, Trackers

if TYPE_CHECKING:
    from appliance.outputs.shared_frame import Facts
    from appliance.sensor.keys import SensorKey

# What a box sends is never answered: two boxes would go on answering each other for ever.
_ANSWERS = frozenset(
    (REPLY, SENSORS_REPLY, PONG, END, STATUS, SENSOR, ROSTER_END, "/motion/is", "/motion/parameter")
)
_LISTED = ("/cues/", "/phrases/", "/looks/", "/cards/", "/hands/", "/fallbacks/")
_ONCE_A_BUNDLE = frozenset((*QUESTIONS, "/sensors/list", "/sensors/reload"))  # the same answer each time
_NO_STAGE = "No stage dances on this box, so nothing is known of its sensors. Start it: bunraku play."

ORDERS: Mapping[str, tuple[Place, str]] = {
    "/player/jump": ("stage", "jump"),
    "/player/excerpt": ("stage", "excerpt"),
    "/springs/kick": ("stage", "kick"),
    "/mocap/setjointrot": ("stage", "hold"),
    "/mocap/setjointpos": ("stage", "place"),
    "/mocap/releasejoint": ("stage", "release"),
    "/sensors/neutral": ("stage", "neutral"),
    "/sensors/heading": ("stage", "heading"),
    "/sensors/strobe": ("stage", "strobe"),
    "/sensors/reload": ("stage", "reload"),
    "/motion/keep": ("generator", "keep"),
    "/lights/walk": ("lights", "walk"),
    "/lights/walk/stop": ("lights", "walk/stop"),
    "/projector/corner": ("projector", "corner"),
    "/projector/corners": ("projector", "corners"),
    "/projector/corners/reset": ("projector", "corners/reset"),
    "/projector/nudge": ("projector", "nudge"),
    "/projector/brightness": ("projector", "brightness"),
    "/projector/mirror": ("projector", "mirror"),
    "/projector/grid": ("projector", "grid"),
    "/projector/info": ("projector", "info"),
}


class CommandHandler:
    """Declares what is to persist, dispatches orders for the rest, and replies.

    refused: commands that were not carried out; reason: why the last one was not. failed: those that ended in
    an error of this program; failure: the last one's.
    """

    def __init__(
        self,
        show_state: ShowState,
        observer: StageObserver,
        dispatch: OrderDispatch,
        keys: KeyFile,
        send: Callable[[Address, Message], None],
        publish: Callable[[ShowState], None],
        live: LiveInput,
    ) -> None:
        self.show_state = show_state
        self.refused = 0
        self.reason = ""
        self.failed, self.failure = 0, ""
        self.acknowledgements = Acknowledgements(observer)
        self._observer, self._dispatch, self._keys = observer, dispatch, keys
        self._send, self._publish, self._live = send, publish, live
        self._trackers = Trackers()
        self._generation = -1
        self._is_new_stage = False

    def handle_datagram(self, received: bytes, asker: Address, now: float) -> None:
        """Carry out what one datagram asks for; never raises, whatever it is."""
        try:
            messages = messages_in(received)
        except ValueError as error:
            self._reply(asker, "", False, str(error))
            return
        once: set[str] = set()
        for address, arguments in messages:
            if address in _ANSWERS or address.startswith(_LISTED):
                self._refuse(f"{address[:LONGEST_NAME]} is an answer, no command.")
                continue
            try:
                if address in TRACKERS:
                    self._follow_tracker(address, arguments, asker, now)
                    continue
                if is_live(address):
                    self._hear_live(address, arguments, now)
                    continue
                if address in once:
                    raise ValueError(f"{address} came twice in a bundle: once is enough.")
                if address in _ONCE_A_BUNDLE:
                    once.add(address)
                self._carry_out(command(address, arguments), asker, now)
            except ValueError as error:
                self._reply(asker, address, False, str(error))
            except Exception as error:
                self.note_failure(address, error, now)
                self._reply(asker, address, False, COMMAND_FAILED.words)

    def note_failure(self, address: str, error: Exception, now: float) -> None:
        """An error of this program, in a command or between two (""): the process goes on, it hears PANIC."""
        about = readable(address[:LONGEST_NAME])
        self.failed += 1
        self.failure = readable(f"{about} {type(error).__name__}: {error}".lstrip())
        self._observer.own.count(COMMAND_FAILED.name, now)
        self._observer.own.concern(COMMAND_FAILED.name, filter(None, [about]))

    def follow_stage(self, now: float) -> None:
        """What has to be done without any command; call it often."""
        self._observer.state(now)
        facts = self._observer.facts
        if facts is not None and self._observer.generation != self._generation:
            self._generation, self._is_new_stage = self._observer.generation, True
            self._publish_changed(of_this_show(self.show_state, facts))
        if self._is_new_stage and facts is not None and (health := self._observer.health()):
            self._is_new_stage = False
            self._adopt(facts, health, now)
        self._note_live(now)
        self.acknowledgements.send_due(now)

    def status(self, strangers: int, now: float) -> Status:
        """How the box is."""
        return status(self.show_state, self._observer, self.refused, strangers, now, self._live.came(now))

    def _adopt(self, facts: Facts, health: Mapping[str, Any], now: float) -> None:
        """After a power cut the stage goes on in its cue: picture and lights too, unless declared since; and
        the generator with the values that were declared for it.

        Its master is left out: a box that was switched on shows something.
        """
        before: Mapping[str, list[float]] = health.get("motion") or {}
        values = {
            name: ("", tuple(given)) for name, given in before.items() if name not in self.show_state.dance
        }
        if values:
            self._publish_changed(self.show_state.with_dance(now, values))
        cue = next((cue for cue in facts.cues if cue["name"] == health.get("cue")), None)
        if cue is not None and not self.show_state.cue:
            parts = [
                part for part in ("look", "card", "camera", "lights") if not getattr(self.show_state, part)
            ]
            adopted = in_cue(self.show_state, {**cue, "fade_s": 0.0}, parts, now)
            if cue.get("springs"):  # the stage's checkpoint does not hold it
                adopted = adopted.with_dance(now, {"springs": (cue["springs"], ())})
            self._publish_changed(adopted)

    def _carry_out(self, command: Command, asker: Address, now: float) -> None:
        """Raises ValueError for what cannot be done."""
        address, observer = command.address, self._observer
        if address == "/ping":
            self._send(asker, (PONG,))
        elif words := let_go(command):
            self._send(asker, (REPLY, address, 0, words))  # not done, and nothing was refused
        elif address in DECLARATIONS:
            self._declare(command, asker, now)
        elif address in QUESTIONS:
            for message in told(address, self.show_state, observer, self.status(0, now), now):
                self._send(asker, message)
        elif address == "/sensors/list":
            self._send_roster(asker, now)
        else:
            self._order(command, asker, now)

    def _declare(self, command: Command, asker: Address, now: float) -> None:
        """Reply at once; about the dance once it follows."""
        address, observer = command.address, self._observer
        before = of_this_show(self.show_state, observer.facts)
        if address in ("/phrase", "/cue"):
            command = replace(command, kept=observer.kept())
        show_state, words = DECLARATIONS[address](before, command, observer.facts, now)
        if address == "/go" and before.going and observer.state(now) == "stopped":
            show_state = show_state.with_dance(now, SHOWS_RATE)
        self._publish_changed(show_state)
        if show_state.generation != before.generation and self._takes_live:
            words = f"{words} {self._live.words(now)}".lstrip()
        reply = partial(self._reply, asker, address)
        if address == "/go" or show_state.generation == before.generation:
            reply(True, words)
        else:
            self.acknowledgements.expect(show_state.generation, words, now, reply)

    def _order(self, command: Command, asker: Address, now: float) -> None:
        place, name = ORDERS[command.address]
        text = joint_name(command.text, self._observer.facts)
        keys = self._keys.keys() if command.address == "/sensors/reload" else _no_keys()
        order = Order(name, command.values, text, keys, quiet=command.address.startswith(STREAMS))
        self._dispatch.dispatch_order(place, order, now, partial(self._reply, asker, command.address))

    def _follow_tracker(self, address: str, arguments: Sequence[object], asker: Address, now: float) -> None:
        for order in self._trackers.orders(address, arguments, self._observer.facts, now):
            self._dispatch.dispatch_order("stage", order, now, partial(self._reply, asker, address))

    def _send_roster(self, asker: Address, now: float) -> None:
        if not self._observer.lives(now):
            raise ValueError(_NO_STAGE)
        key_file = str(self._keys.path or "")
        for message in roster_messages(self._observer.health(), key_file, now):
            self._send(asker, message)

    def _publish_changed(self, show_state: ShowState) -> None:
        if show_state != self.show_state:
            self._publish(show_state)
            self.show_state = show_state

    def _reply(self, asker: Address, address: str, done: bool, words: str) -> None:
        """Reply to a command; to one of a stream only that it is not done."""
        if done and address.startswith(STREAMS):
            return
        if not done:
            self._refuse(words)
        reply = SENSORS_REPLY if address.startswith("/sensors/") else REPLY
        self._send(asker, (reply, address[:LONGEST_NAME], int(done), words or "Done."))

    @property
    def _takes_live(self) -> bool:
        """Whether the show is to start from a live dancer."""
        show_state, facts = self.show_state, self._observer.facts
        is_ours = facts is not None and show_state.show == facts.show_name
        return is_ours and show_state.dance.get("phrase", (0, "", ()))[1] == LIVE

    def _hear_live(self, address: str, arguments: Sequence[object], now: float) -> None:
        try:
            self._live.hear(address, arguments, self._observer.facts, now)
        except ValueError as error:  # programs of motion capture hear no reply
            self._observer.own.count(LIVE_REFUSED.name, now)
            self._observer.own.concern(LIVE_REFUSED.name, [readable(str(error))])
            raise

    def _note_live(self, now: float) -> None:
        missing = self._live.partial(now) if self._takes_live else ""
        self._observer.own.set(LIVE_PARTIAL.name, bool(missing))
        self._observer.own.concern(LIVE_PARTIAL.name, filter(None, [missing]))

    def _refuse(self, reason: str) -> None:
        self.refused += 1
        self.reason = readable(reason)


def _no_keys() -> Mapping[str, SensorKey]:
    return {}
