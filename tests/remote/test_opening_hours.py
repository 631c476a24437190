"""Opening hours on a clock of the test's, and projectors that speak the real protocol."""

from __future__ import annotations

import datetime
import hashlib
import socket
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from appliance.box.roster import RosterLine
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, GOING, STRINGS
from appliance.remote.caretaker import Caretaker, OpeningHours
from appliance.remote.pjlink import PjLinkError, ProjectorPower, Seen, ask
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.opening_hours import HoursConfig
from appliance.show_control.packet import Message
from hw_sim.peers import HOST
from tests.system.processes import wait_until

WEEK = [
    {"days": ["tue", "wed", "thu", "fri"], "from": "10:00", "to": "18:00"},
    {"days": ["sat"], "from": "20:00", "to": "02:00"},
]
LINKED = RosterLine(*("left-wrist", "1a2b3c4d", "linked", "", 50.0, 0.0, 0.0, 0.0, 87, 0, 0, "", "", "", ""))
BERLIN = datetime.timezone(datetime.timedelta(hours=1))


def hours_of(**values: Any) -> HoursConfig:
    return HoursConfig.model_validate({"open": WEEK, "zone": "Europe/Berlin", **values})


def at(text: str) -> float:
    """Unix seconds of a winter's day and time in Berlin; 2026-12-01 is a Tuesday."""
    return datetime.datetime.fromisoformat(f"2026-12-{text}:00").replace(tzinfo=BERLIN).timestamp()


@pytest.mark.parametrize(
    ("moment", "is_open", "following"),
    [
        ("01T09:59", False, "tue 10:00"),
        ("01T10:00", True, "tue 18:00"),
        ("01T18:00", False, "wed 10:00"),
        ("05T23:00", True, "sun 02:00"),  # a Saturday
        ("06T01:59", True, "sun 02:00"),
        ("06T02:00", False, "tue 10:00"),
        ("06T21:00", False, "tue 10:00"),  # Sunday
        ("07T12:00", False, "tue 10:00"),  # Monday
        ("24T12:00", False, "wed 10:00"),  # a holiday until the 29th
    ],
)
def test_days_nights_and_holidays(moment: str, is_open: bool, following: str) -> None:
    hours = OpeningHours(hours_of(closed=["2026-12-24 to 2026-12-29"]))
    assert hours.is_open(at(moment)) == is_open
    assert hours.next_change(at(moment)) == following


def test_hours_are_those_of_the_clock_on_the_wall_also_in_summer() -> None:
    hours = OpeningHours(hours_of(open=[{"from": "10:00", "to": "18:00"}]))
    summer = datetime.timezone(datetime.timedelta(hours=2))
    opens = datetime.datetime(2027, 7, 1, 10, 0, tzinfo=summer).timestamp()
    assert [hours.is_open(opens - 1), hours.is_open(opens)] == [False, True]


@pytest.mark.parametrize(
    ("zone", "night", "opens", "closes"),
    [
        ("Europe/Berlin", "2027-10-30T18:00+00:00", "20:00", "02:30"),
        ("Europe/Berlin", "2027-10-30T18:00+00:00", "02:15", "08:00"),
        ("Europe/Berlin", "2027-03-27T18:00+00:00", "20:00", "02:30"),  # this one does not come at all
        ("Australia/Lord_Howe", "2027-04-03T06:00+00:00", "20:00", "01:45"),  # half an hour comes twice
        ("America/St_Johns", "2027-11-06T18:00+00:00", "20:00", "01:30"),
    ],
)
def test_in_a_night_whose_clock_is_turned_it_opens_once_and_closes_once(
    zone: str, night: str, opens: str, closes: str
) -> None:
    hours = OpeningHours(hours_of(zone=zone, open=[{"days": ["sat", "sun"], "from": opens, "to": closes}]))
    begin = datetime.datetime.fromisoformat(night).timestamp()
    seen = [hours.is_open(begin + 60.0 * minute) for minute in range(14 * 60)]
    assert sum(before != after for before, after in pairwise(seen)) == 2 - seen[0]


def test_quiet_hours_end_once_in_a_night_whose_clock_is_turned() -> None:
    hours = OpeningHours(hours_of(quiet=[{"from": "22:00", "to": "02:30", "strings": 0.2}]))
    begin = datetime.datetime.fromisoformat("2027-10-30T18:00+00:00").timestamp()
    seen = [hours.strings(begin + 60.0 * minute) for minute in range(14 * 60)]
    assert sum(before != after for before, after in pairwise(seen)) == 2


def test_a_clock_that_was_never_set_is_always_open() -> None:
    """Null: 1970 was a Thursday, at midnight closed."""
    hours = OpeningHours(hours_of(quiet=[{"from": "00:00", "to": "24:00"}]))
    assert (hours.is_open(5.0), hours.strings(5.0)) == (True, 1.0)


class House:
    """A caretaker, its clock, and show control that does what it is told."""

    def __init__(self, folder: Path, config: HoursConfig, moment: str) -> None:
        self.wall, self.now, self.state = at(moment), 1000.0, ShowState()
        self.given: list[Message] = []
        self.hears = True
        self.sensors: list[list[Any]] = []
        self._folder, self._config = folder, config
        self.restart()

    def restart(self) -> None:
        self.caretaker = Caretaker(self._config, self._folder, self._give, lambda: self.wall)

    def until(self, moment: str, step_s: float = 15.0) -> list[Message]:
        """Live until then; the commands that were given."""
        self.given.clear()
        while self.wall < at(moment):
            self.wall, self.now = self.wall + step_s, self.now + step_s
            self.caretaker.turn(self.state, {"sensors": self.sensors}, "", self.now)
        return list(self.given)

    def _give(self, message: Message) -> None:
        self.given.append(message)
        address, *values = message
        if not self.hears:
            return
        if address in ("/go", "/stop"):
            self.state = self.state.to(GOING, float(address == "/go"))
        elif address == "/cue":
            self.state = self.state.to(CUE, str(values[0]))
        elif address == "/strings":
            self.state = self.state.to(STRINGS, float(values[0]))


def test_a_day_opens_and_closes_and_people_may_differ(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(open_cue="walk in", close_cue="end"), "01T09:00")
    assert house.until("01T09:01") == [("/stop",)]  # switched on before the doors open
    assert house.until("01T10:01") == [("/go",), ("/cue", "walk in")]
    house.state = house.state.to(GOING, 0.0)  # by hand
    house.restart()
    assert house.until("01T12:00") == []
    house.state = house.state.to(GOING, 1.0)
    assert house.until("01T17:58") == []
    assert house.until("01T18:01") == [("/cue", "end"), ("/stop",)]
    house.state = house.state.to(GOING, 1.0)  # a rehearsal after hours
    assert house.until("01T20:00") == []


def test_panic_is_not_lifted_by_a_clock(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(), "01T09:00")
    house.until("01T09:30")
    house.state = ShowState(panic=True, settings=house.state.settings)
    assert house.until("01T10:30") == []


def test_a_stop_that_nobody_hears_is_given_again(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(), "01T08:00")
    house.hears = False
    assert len(house.until("01T08:01", 1.0)) == 59
    house.hears = True
    assert len(house.until("01T08:02")) == 1


def test_an_opening_that_nobody_hears_is_given_again(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(open_cue="walk in"), "01T09:00")
    house.until("01T09:59")
    house.hears = False
    house.until("01T10:00")
    house.restart()
    assert house.until("01T10:01", 15.0) == [("/go",), ("/cue", "walk in")] * 4
    house.hears = True
    assert house.until("01T10:02") == [("/go",), ("/cue", "walk in")]
    house.state = house.state.to(GOING, 0.0)  # by hand
    assert house.until("01T10:30") == []


def test_what_is_refused_is_not_given_for_ever(tmp_path: Path) -> None:
    """By the box of a pair that follows: it would be carried out hours later, when that takes over."""
    house = House(tmp_path, hours_of(quiet=[{"from": "12:00", "to": "13:00", "strings": 0.2}]), "01T09:00")
    house.until("01T09:59")
    house.hears = False
    assert house.until("01T11:00") == [("/go",)] * 10
    assert house.until("01T12:30") == [("/strings", 0.2, 5.0)] * 10
    assert house.until("01T13:30") == []


def test_an_opening_that_is_not_heard_does_not_lift_a_panic(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(), "01T09:00")
    house.until("01T09:59")
    house.hears = False
    assert house.until("01T10:01") == [("/go",)] * 5
    house.state, house.hears = ShowState(panic=True, settings=house.state.settings), True
    assert house.until("01T10:30") == []


def test_quiet_hours_that_nobody_hears_are_given_again(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(quiet=[{"from": "22:00", "to": "01:00", "strings": 0.2}]), "05T21:59")
    house.state, house.hears = house.state.to(STRINGS, 0.7), False
    assert house.until("05T22:01")[:2] == [("/strings", 0.2, 5.0)] * 2
    house.restart()
    house.hears = True
    assert house.until("05T22:10") == [("/strings", 0.2, 5.0)]
    house.hears = False
    assert house.until("06T01:01")[:2] == [("/strings", 0.7, 5.0)] * 2
    house.state = house.state.to(STRINGS, 0.5)  # by hand
    assert house.until("06T01:10") == []


def test_quiet_hours_and_the_loudness_before_them(tmp_path: Path) -> None:
    config = hours_of(quiet=[{"from": "22:00", "to": "01:00", "strings": 0.2}])
    house = House(tmp_path, config, "05T20:00")
    house.state = house.state.to(STRINGS, 0.7)
    assert house.until("05T22:01") == [("/strings", 0.2, 5.0)]
    house.restart()
    assert house.until("06T01:01") == [("/strings", 0.7, 5.0)]


def test_a_cue_while_nobody_is_there(tmp_path: Path) -> None:
    config = hours_of(attract={"cue": "waiting", "after_s": 90})
    house = House(tmp_path, config, "01T10:10")
    house.state = house.state.to(CUE, "duet")
    house.sensors = [LINKED]
    assert house.until("01T10:20") == []
    house.sensors = [["left-wrist", "silent"]]
    assert house.until("01T10:21") == []
    assert house.until("01T10:30") == [("/cue", "waiting")]
    house.sensors = [LINKED]
    assert house.until("01T10:31") == [("/cue", "duet")]
    house.sensors = []
    house.until("01T10:40")
    house.state = house.state.to(CUE, "solo")  # by hand
    house.sensors = [LINKED]
    assert house.until("01T10:41") == []


def test_a_cue_that_nobody_hears_is_called_again(tmp_path: Path) -> None:
    """For a while: one that the show does not have is refused each time."""
    house = House(tmp_path, hours_of(attract={"cue": "waiting", "after_s": 90}, close_cue="end"), "01T10:10")
    house.state = house.state.to(CUE, "duet")
    house.hears = False
    assert house.until("01T10:30") == [("/cue", "waiting")] * 10
    house.restart()
    house.state, house.sensors = house.state.to(CUE, "waiting"), [LINKED]
    assert house.until("01T10:31") == [("/cue", "duet")] * 4
    house.hears = True
    assert house.until("01T10:35") == [("/cue", "duet")]
    house.hears = False
    house.until("01T17:58")
    assert house.until("01T17:59") == [("/cue", "end")]
    house.state = house.state.to(CUE, "solo")  # by hand
    assert {*house.until("01T18:01")} == {("/stop",)}


def test_a_cue_for_nobody_is_not_called_again_once_somebody_is_there(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(attract={"cue": "waiting", "after_s": 90}), "01T10:10")
    house.state, house.hears = house.state.to(CUE, "duet"), False
    assert ("/cue", "waiting") in house.until("01T10:12")
    house.sensors, house.hears = [LINKED], True
    assert house.until("01T10:30") == [] and house.state.cue == "duet"


def test_nobody_is_missed_anew_each_day(tmp_path: Path) -> None:
    """Yesterday's last visitor left before it closed, and the cue of the day has taken the place since."""
    config = hours_of(open_cue="walk in", attract={"cue": "waiting", "after_s": 90})
    house = House(tmp_path, config, "01T17:00")
    assert house.until("01T18:01") == [("/cue", "waiting"), ("/stop",)]
    house.until("02T09:59")
    assert house.until("02T10:01") == [("/go",), ("/cue", "walk in")]
    assert house.until("02T10:03") == [("/cue", "waiting")]
    house.sensors = [LINKED]
    assert house.until("02T10:04") == [("/cue", "walk in")]


def test_the_cue_before_the_night_comes_back_where_none_opens_the_day(tmp_path: Path) -> None:
    house = House(tmp_path, hours_of(attract={"cue": "waiting", "after_s": 90}), "01T17:00")
    house.state = house.state.to(CUE, "duet")
    assert house.until("02T10:30") == [("/cue", "waiting"), ("/stop",), ("/go",)]
    house.sensors = [LINKED]
    assert house.until("02T10:31") == [("/cue", "duet")]


class Projector:
    """A projector as PJLink class 1 has it; it takes a moment to warm up."""

    def __init__(self, password: str = "") -> None:
        self.state, self.errors, self.commands, self._password = "0", "000000", [], password  # type: ignore[var-annotated]
        self.tells_errors = True  # also in standby
        self.connections, self.ends_each = 0, False
        self.greeting = b"PJLINK 1 498e4a67\r" if password else b"PJLINK 0\r"
        self._listening = socket.create_server((HOST, 0))
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                one, _ = self._listening.accept()
            except OSError:
                return
            self.connections += 1
            with one, one.makefile("rwb", buffering=0) as line:
                line.write(self.greeting)
                received = b""
                while byte := line.read(1):
                    received += byte
                    if byte == b"\r":
                        line.write(self._answer(received[:-1].decode()))
                        received = b""
                        if self.ends_each:
                            break

    def _answer(self, command: str) -> bytes:
        digest = hashlib.md5(f"498e4a67{self._password}".encode()).hexdigest() if self._password else ""
        if digest and not self.commands and not command.startswith(digest):
            return b"PJLINK ERRA\r"
        command = command.removeprefix(digest)
        self.commands.append(command)
        if command == "%1POWR ?":
            return f"%1POWR={self.state}\r".encode()
        if command == "%1ERST ?":
            return f"%1ERST={self.errors if self.tells_errors or self.state == '1' else 'ERR3'}\r".encode()
        if command in ("%1POWR 1", "%1POWR 0"):
            self.state = "3" if command[-1] == "1" else "2"
            return b"%1POWR=OK\r"
        return b"%1XXXX=ERR1\r"

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)  # accept would hold it open
        self._listening.close()


@pytest.fixture
def projector() -> Iterator[Projector]:
    one = Projector()
    yield one
    one.close()


def test_a_projector_is_switched_and_kept_so(projector: Projector) -> None:
    power = ProjectorPower(HOST, projector.port, look_s=0.05)
    wait_until(lambda: power.seen == Seen("off", ""), lambda: str(power.seen))
    power.want(True)
    wait_until(lambda: power.seen.state == "warming", lambda: str(power.seen))
    projector.state = "1"
    wait_until(lambda: power.seen.state == "on", lambda: str(power.seen))
    projector.state, projector.errors = "0", "020000"  # a cut of its power, and a lamp that has failed
    wait_until(lambda: power.seen == Seen("warming", "reports a fault: lamp"), lambda: str(power.seen))
    power.want(False)
    time.sleep(0.1)
    assert projector.commands.count("%1POWR 0") == 0  # it is not switched while it warms up
    projector.state = "1"
    wait_until(lambda: projector.state == "2", lambda: str(power.seen))
    power.close()


def test_a_projector_that_tells_no_errors_in_standby_is_switched_on(projector: Projector) -> None:
    projector.tells_errors = False
    power = ProjectorPower(HOST, projector.port, look_s=0.05)
    wait_until(lambda: power.seen == Seen("off", ""), lambda: str(power.seen))
    power.want(True)
    wait_until(lambda: projector.state == "3", lambda: str(power.seen))
    projector.state = "1"
    wait_until(lambda: power.seen == Seen("on", ""), lambda: str(power.seen))
    power.close()


def test_a_projector_is_asked_and_switched_by_one_connection_a_look(projector: Projector) -> None:
    """Also where it refuses to tell its errors: a second connection is refused by many for seconds."""
    projector.tells_errors = False
    power = ProjectorPower(HOST, projector.port, look_s=3600.0)
    wait_until(lambda: power.seen == Seen("off", ""), lambda: str(power.seen))
    assert projector.connections == 1
    power.want(True)
    wait_until(lambda: power.seen == Seen("warming", ""), lambda: str(power.seen))
    assert projector.connections == 2
    assert projector.commands == [f"%1{one}" for one in ("POWR ?", "ERST ?", "POWR ?", "POWR 1", "ERST ?")]
    power.close()


def test_a_projector_that_ends_the_connection_after_each_answer_is_switched(projector: Projector) -> None:
    projector.ends_each = True
    power = ProjectorPower(HOST, projector.port, look_s=3600.0)
    power.want(True)
    wait_until(lambda: power.seen == Seen("warming", ""), lambda: str(power.seen))
    power.close()


def test_a_projector_that_is_switched_on_after_hours_stays_on(projector: Projector) -> None:
    """By hand, for a rehearsal; the next change counts again."""
    projector.state = "1"
    power = ProjectorPower(HOST, projector.port, look_s=0.05)
    power.want(False)
    wait_until(lambda: power.seen.state == "cooling", lambda: str(power.seen))
    projector.state = "0"
    wait_until(lambda: power.seen.state == "off", lambda: str(power.seen))
    projector.state = "1"
    wait_until(lambda: power.seen.state == "on", lambda: str(power.seen))
    time.sleep(0.2)
    assert projector.state == "1"
    power.want(True)
    power.want(False)
    wait_until(lambda: projector.state == "2", lambda: str(power.seen))
    power.close()


def test_a_greeting_that_is_cut_off_is_told_and_asked_again(projector: Projector) -> None:
    whole, projector.greeting = projector.greeting, b"PJLINK 1\r"
    power = ProjectorPower(HOST, projector.port, "secret", look_s=0.05)
    wait_until(lambda: power.seen == Seen("unknown", "speaks no PJLink"), lambda: str(power.seen))
    projector.greeting = whole
    wait_until(lambda: power.seen == Seen("off", ""), lambda: str(power.seen))
    power.close()


def test_passwords_and_what_is_no_projector() -> None:
    with_password = Projector("JBMIAProjectorLink")
    assert ask(HOST, with_password.port, "JBMIAProjectorLink", "POWR ?", "ERST ?") == ["0", "000000"]
    with_password.commands.clear()
    with pytest.raises(PjLinkError, match="refuses the password"):
        ask(HOST, with_password.port, "wrong", "POWR ?")
    with pytest.raises(PjLinkError, match="asks for a password"):
        ask(HOST, with_password.port, None, "POWR ?")
    with pytest.raises(PjLinkError, match="knows no such command"):
        ask(HOST, with_password.port, "JBMIAProjectorLink", "LAMP ?")
    with_password.close()
    power = ProjectorPower(HOST, with_password.port, look_s=0.05)
    wait_until(lambda: "does not answer" in power.seen.trouble, lambda: str(power.seen))
    power.close()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hours: {open: [{from: '10:00', to: '10:00'}]}", "opens and closes at the same time"),
        ("hours: {open: [{from: '10:70', to: '12:00'}]}", "no time of day"),
        ("hours: {open: [{from: '10:00', to: '12:00'}], closed: ['24.12.']}", "is no date"),
        ("hours: {open: [{from: '10:00', to: '12:00'}], zone: Europe/Berlim}", "no time zone"),
        ("hours: {open: []}", "open"),
    ],
)
def test_hours_that_cannot_be_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "box.yaml").write_text(text + "\n")
    with pytest.raises(ConfigError, match=message):
        load_box(tmp_path / "box.yaml")
