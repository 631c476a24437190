"""The command handler: every command becomes a declaration in the show state, an order or an answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from appliance.box.orders import Key, Order
from appliance.box.roster import Roster
from appliance.levers.addresses import ADDRESSES, ANSWERS, QUESTIONS, Receiver
from appliance.levers.lever import Lever
from appliance.levers.show_state import Change, ShowState
from appliance.levers.sources import LIVE
from appliance.levers.status import STATUS, Status
from appliance.levers.table import CAMERA, CARD, CUE, LIGHTS, LOOK, PHRASE, RATE, SPRINGS, find_lever
from appliance.show_control.acknowledgements import Acknowledgements
from appliance.show_control.command import (
    LONGEST_NAME,
    PONG,
    REPLY,
    SENSORS_REPLY,
    STREAMS,
    Command,
    command,
    reply_to,
)
from appliance.show_control.fallback import COMMAND_FAILED, LIVE_PARTIAL, LIVE_REFUSED
from appliance.show_control.figure_datagram import DATAGRAM, is_figure
from appliance.show_control.gestures import Gestures
from appliance.show_control.key_file import KeyFile
from appliance.show_control.live_input import LiveInput, is_live
from appliance.show_control.names_of_show import joint_name
from appliance.show_control.order_dispatch import OrderDispatch
from appliance.show_control.packet import Message, messages_in, readable
from appliance.show_control.port import Address
from appliance.show_control.sensor_roster import END as ROSTER_END
from appliance.show_control.sensor_roster import SENSOR, roster_messages
from appliance.show_control.show_state_commands import declare, in_cue, let_go, of_this_show
from appliance.show_control.stage_observer import StageObserver
from appliance.show_control.status_messages import END, answer_to, status
from appliance.show_control.vmc_input import TRACKERS, Trackers

if TYPE_CHECKING:
    from appliance.outputs.shared_frame import Facts

# Messages of a box are never answered: two boxes would go on answering each other for ever.
_ANSWERS = frozenset((*ANSWERS, REPLY, SENSORS_REPLY, PONG, END, SENSOR, ROSTER_END))
_LISTED = (
    f"{STATUS}/",
    *(f"{question.address}/" for question in QUESTIONS if question.address not in ("/motion", "/status")),
)
_QUESTIONS = frozenset(question.address for question in QUESTIONS)
_ONCE_A_BUNDLE = frozenset((*_QUESTIONS, "/sensors/list", "/sensors/reload"))  # the same answer each time
_NO_STAGE = "No stage dances on this box, so nothing is known of its sensors. Start it: bunraku play."
# Adopted from the stage's cue; its checkpoint has the rest.
_ADOPTED: tuple[Lever[Any], ...] = (CUE, LOOK, CARD, CAMERA, LIGHTS, SPRINGS)


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
        gestures: Gestures | None = None,
    ) -> None:
        self.show_state = show_state
        self.refused = 0
        self.reason = ""
        self.failed, self.failure = 0, ""
        self.acknowledgements = Acknowledgements(observer)
        self._observer, self._dispatch, self._keys = observer, dispatch, keys
        self._send, self._publish, self._live = send, publish, live
        self.gestures = gestures
        self._trackers = Trackers()
        self.follows = False  # another box leads: what is declared comes from there
        self._generation = -1
        self._is_new_stage = False

    def handle_datagram(self, received: bytes, asker: Address, now: float) -> None:
        """Carry out what one datagram asks for; never raises, whatever it is."""
        try:
            messages = [(DATAGRAM, [received])] if is_figure(received) else messages_in(received)
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
                self._reply(asker, address, False, COMMAND_FAILED.message)

    def note_failure(self, address: str, error: Exception, now: float) -> None:
        """An error of this program, in a command or between two (""): the process goes on, it hears PANIC."""
        about = readable(address[:LONGEST_NAME])
        self.failed += 1
        self.failure = readable(f"{about} {type(error).__name__}: {error}".lstrip())
        self._observer.own.count(COMMAND_FAILED.name, now)
        self._observer.own.concern(COMMAND_FAILED.name, filter(None, [about]))

    def follow_stage(self, now: float) -> None:
        """Does everything that is due without a command; call it often."""
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

    def follow_leader(self, show_state: ShowState) -> None:
        """Another box leads, and declared this."""
        self._publish_changed(show_state)

    def report(self, strangers: int, now: float) -> dict[str, Any]:
        """The part of the status that only this process knows."""
        reported = self.gestures.reported() if self.gestures is not None else {}
        return {
            "refused": self.refused,
            "strangers": strangers,
            "live": self._live.came(now),
            "gestures": reported,
            "key_file": str(self._keys.path or ""),
        }

    def call_cue(self, name: str, now: float) -> None:
        """A cue that nobody asked for by a command; nothing where the show has none of that name."""
        facts = self._observer.facts
        try:
            command = Command("/cue", (), name)
            show_state, _ = declare(of_this_show(self.show_state, facts), command, facts, now)
        except ValueError as error:
            self._refuse(str(error))
            return
        self._publish_changed(show_state)

    def status(self, strangers: int, now: float) -> Status:
        """How the box is."""
        return status(self.show_state, self._observer, self.refused, strangers, now, self._live.came(now))

    def _adopt(self, facts: Facts, health: Mapping[str, Any], now: float) -> None:
        """After a power cut the stage goes on in its cue: picture and lights too, unless declared since; and
        the generator with the values that were declared for it.

        Its master is left out: a box that was switched on shows something.
        """
        before: Mapping[str, list[float]] = health.get("motion") or {}
        changes = [
            Change(one, one.given("", given)[0])
            for name, given in before.items()
            if (one := find_lever(name)) is not None and one not in self.show_state
        ]
        cue = next((cue for cue in facts.cues if cue["name"] == health.get("cue")), None)
        if cue is not None and not self.show_state.cue:
            adopted = [one for one in _ADOPTED if not self.show_state[one].value]
            changes += [one._replace(seconds=0.0) for one in in_cue(cue, facts) if one.lever in adopted]
        if changes:
            self._publish_changed(self.show_state.changed(now, changes))

    def _carry_out(self, command: Command, asker: Address, now: float) -> None:
        """Raises ValueError for what cannot be done."""
        address, observer = command.address, self._observer
        if address == "/ping":
            self._send(asker, (PONG,))
        elif text := let_go(command):
            self._send(asker, (REPLY, address, 0, text))  # not done, and nothing was refused
        elif address.startswith("/gesture"):
            self._hear_of_gestures(command, asker, now)
        elif address in _QUESTIONS:
            for message in answer_to(address, self.show_state, observer, self.status(0, now), now):
                self._send(asker, message)
        elif address == "/sensors/list":
            self._send_roster(asker, now)
        elif self.follows and (ADDRESSES[address].order or ("stage",))[0] != "projector":
            raise ValueError("This box follows the other one of its pair: send it there.")
        elif (order := ADDRESSES[address].order) is not None:
            self._order(*order, command, asker, now)
        else:
            self._declare(command, asker, now)

    def _declare(self, command: Command, asker: Address, now: float) -> None:
        """Reply at once; about the dance once it follows."""
        address, observer = command.address, self._observer
        before = of_this_show(self.show_state, observer.facts)
        if address in ("/phrase", "/cue"):
            command = replace(command, saved=observer.saved())
        show_state, message = declare(before, command, observer.facts, now)
        if address == "/go" and before.going and observer.state(now) == "stopped":
            show_state = show_state.to(RATE, None, now)
        self._publish_changed(show_state)
        if show_state.generation != before.generation and self._takes_live:
            message = f"{message} {self._live.message(now)}".lstrip()
        reply = partial(self._reply, asker, address)
        if address == "/go" or show_state.generation == before.generation:
            reply(True, message)
        else:
            self.acknowledgements.expect(show_state.generation, message, now, reply)

    def _order(self, place: Receiver, name: str, command: Command, asker: Address, now: float) -> None:
        text = joint_name(command.text, self._observer.facts)
        keys: Mapping[str, Key] = {}
        if command.address == "/sensors/reload":
            keys = {sensor: (one.device_id, one.key) for sensor, one in self._keys.keys().items()}
        order = Order(name, command.values, text, keys, quiet=command.address.startswith(STREAMS))
        self._dispatch.dispatch_order(place, order, now, partial(self._reply, asker, command.address))

    def _follow_tracker(self, address: str, arguments: Sequence[object], asker: Address, now: float) -> None:
        for order in self._trackers.orders(address, arguments, self._observer.facts, now):
            self._dispatch.dispatch_order("stage", order, now, partial(self._reply, asker, address))

    def _hear_of_gestures(self, command: Command, asker: Address, now: float) -> None:
        if (gestures := self.gestures) is None:
            raise ValueError("This box knows no gestures.")
        if command.address == "/gestures":
            reported = gestures.reported()
            answers: list[Message] = [
                ("/gestures/gesture", one["name"], one["cue"], one["hand"]) for one in reported["list"]
            ]
            if (now_made := reported["recording"]) is not None:
                answers.append(("/gestures/recording", now_made["name"], now_made["come"], reported["most"]))
            for answer in (*answers, (END, command.address, len(answers))):
                self._send(asker, answer)
            return
        name = str(command.text)
        if command.address == "/gesture/record":
            message = gestures.record(name, command.also, now)
        elif command.address == "/gesture/rename":
            message = gestures.rename(name, command.also)
        else:
            message = gestures.stop() if command.address == "/gesture/stop" else gestures.forget(name)
        self._reply(asker, command.address, True, message)

    def _send_roster(self, asker: Address, now: float) -> None:
        if not self._observer.lives(now):
            raise ValueError(_NO_STAGE)
        roster = Roster.reported(self._observer.health())
        for message in roster_messages(roster, str(self._keys.path or ""), now):
            self._send(asker, message)

    def _publish_changed(self, show_state: ShowState) -> None:
        if show_state != self.show_state:
            self._publish(show_state)
            self.show_state = show_state

    def _reply(self, asker: Address, address: str, done: bool, message: str) -> None:
        """Reply to a command; to one of a stream only that it is not done."""
        if done and address.startswith(STREAMS):
            return
        if not done:
            self._refuse(message)
        self._send(asker, (reply_to(address), address[:LONGEST_NAME], int(done), message or "Done."))

    @property
    def _takes_live(self) -> bool:
        """Whether the show is to start from a live dancer."""
        show_state, facts = self.show_state, self._observer.facts
        is_ours = facts is not None and show_state.show == facts.show_name
        return is_ours and show_state[PHRASE].value == LIVE

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
