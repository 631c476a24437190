"""What follows a code: cues at their times, and a phrase that keeps in step."""

from __future__ import annotations

import math

import pytest

from appliance.remote.chase import CueChase, DanceChase, timed_cues
from appliance.remote.timecode import BY_NAME, DAY_S
from appliance.show_control.packet import Message

TV = BY_NAME["25"]
LENGTH_S = 60.0


def test_cues_are_called_as_their_time_comes() -> None:
    cues = timed_cues(
        [{"name": "b", "at": "00:00:20:00"}, {"name": "a", "at": "00:00:10:12"}, {"name": "by hand"}], TV
    )
    assert cues == [(10.48, "a"), (20.0, "b")]
    chase = CueChase()
    times = [0.0, 10.4, 10.48, 15.0, None, 16.0, 20.1, 21.0, 12.0, 5.0, 10.5]
    assert [chase.due(one, cues) for one in times] == [
        *(None, None, "a", None, None, None, "b", None),
        *("a", None, "a"),  # back: the one in force there; before the first there is none
    ]
    assert chase.start(12.0) == 10.48


def test_a_code_that_hardly_goes_back_calls_no_cue_again() -> None:
    """It stands two frames before a cue, and is taken to run for three more; or a label comes late."""
    cues, chase = [(5.0, "a"), (10.48, "b")], CueChase()
    for late_s in (0.001, 0.04, 0.08):
        assert chase.due(10.49, cues) in ("b", None)
        assert chase.due(10.48 - late_s, cues) is None
        assert chase.start(10.48 - late_s) == 10.48
    assert chase.due(10.3, cues) == "a"
    assert chase.start(10.3) == 5.0


def test_at_midnight_the_cue_in_force_stays_and_each_comes_again() -> None:
    cues, chase = [(10.0, "a"), (20.0, "b")], CueChase()
    times = [DAY_S - 1.0, DAY_S + 5.0, DAY_S + 11.0, DAY_S + 21.0, 2 * DAY_S + 21.0]
    assert [chase.due(one, cues) for one in times] == ["b", None, "a", "b", "b"]
    assert chase.start(2 * DAY_S + 21.0) == 2 * DAY_S + 20.0
    assert chase.due(21.0, cues) is None, "the code has jumped, and counts anew: the same cue is in force"
    assert chase.due(11.0, cues) == "a"


class Player:
    """A stage that plays a phrase by the box's own clock, and tells of itself once a second."""

    def __init__(self, position_s: float, drift: float) -> None:
        self.now, self.position_s, self.rate, self._drift = 0.0, position_s, 1.0, drift
        self.commands: list[Message] = []

    def second(
        self, chase: DanceChase, code_s: float | None, speed: float = 1.0, stands: bool = False
    ) -> None:
        self.now += 1.0
        self.position_s = (self.position_s + self.rate * (1.0 + self._drift)) % LENGTH_S
        led = {"is_led": True, "position_s": self.position_s, "excerpt_s": [0.0, LENGTH_S], "made": ""}
        health = {"puppets": [led], "looked_at": self.now}
        for message in chase.follow(health, code_s, 1.0, stands, self.now):
            self.commands.append(message)
            address, *values = message
            if address == "/player/jump":
                self.position_s = float(values[0])
            else:
                self.rate = float(values[0]) if values else 1.0


def distance(player: Player, code_s: float) -> float:
    away = (player.position_s - code_s) % LENGTH_S
    return min(away, LENGTH_S - away)


@pytest.mark.parametrize("drift", [1 / 3600, -1 / 3600, 0.002])
def test_a_drift_is_corrected_without_a_jump(drift: float) -> None:
    """Null: the phrase that only began together is 3600 times the drift away after the hour."""
    player, chase = Player(0.0, drift), DanceChase(tolerance_s=0.5)
    worst, rates = 0.0, []
    for second in range(1, 3601):
        player.second(chase, second % LENGTH_S)
        worst = max(worst, distance(player, second % LENGTH_S))
        rates.append(player.rate)
    assert not [one for one in player.commands if one[0] == "/player/jump"]
    assert worst < 0.06
    assert max(abs(rate - 1.0) for rate in rates) < 0.031
    assert len(player.commands) < 720


def test_a_code_that_jumps_takes_the_phrase_along_at_once() -> None:
    player, chase = Player(0.0, 0.0), DanceChase(tolerance_s=0.5)
    for second in range(1, 5):
        player.second(chase, float(second))
    for second in range(30, 40):
        player.second(chase, float(second))
        assert distance(player, second) < 0.5
    assert [one[0] for one in player.commands].count("/player/jump") == 1
    assert not math.isclose(player.position_s, 14.0)


def test_a_code_that_stands_holds_the_phrase_and_one_that_is_away_lets_it_go() -> None:
    player, chase = Player(10.0, 0.0), DanceChase(tolerance_s=0.5)
    for second in range(11, 14):
        player.second(chase, float(second))
    for _ in range(4):
        player.second(chase, 13.0, stands=True)
    assert player.rate == 0.0
    assert distance(player, 13.0) < 1.1
    player.second(chase, None)
    assert player.commands[-1] == ("/player/start",)
    count = len(player.commands)
    player.second(chase, None)
    assert len(player.commands) == count


def test_what_is_made_ahead_is_left_alone() -> None:
    chase = DanceChase(tolerance_s=0.5)
    led = {"is_led": True, "position_s": 1.0, "excerpt_s": [0.0, 60.0], "made": "vary 1.2"}
    assert list(chase.follow({"puppets": [led], "looked_at": 1.0}, 30.0, 1.0, False, 1.0)) == []
