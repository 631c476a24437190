"""The show state: the fade of each lever is a function of the moment; other releases can be read."""

from __future__ import annotations

import json

import pytest

from appliance.levers.fade import Fade
from appliance.levers.show_state import Change, ShowState, packed, unpacked
from appliance.levers.table import (
    CAMERA,
    CARD,
    CUE,
    GOING,
    ITERATIONS,
    LEVERS,
    LIGHTS,
    LOOK,
    MADE_NUMBERS,
    MASTER,
    PATH_POINTS,
    PHRASE,
    RATE,
    SPRINGS,
    STORM,
    WIND,
    find_lever,
    hand,
)

NOW = 1000.0


def test_by_itself_the_show_runs_in_full_light() -> None:
    state = ShowState()
    assert state.level(NOW) == 1.0 and state.going and state.cue == ""
    assert not state.is_safe(NOW)
    assert state[LOOK].share(NOW) == state[LIGHTS].share(NOW) == 1.0


def test_panic_is_black_and_safe_at_once_and_blackout_is_only_black() -> None:
    panic, blackout = ShowState(panic=True), ShowState(blackout=True)
    assert (panic.level(NOW), panic.is_safe(NOW)) == (0.0, True)
    assert (blackout.level(NOW), blackout.is_safe(NOW)) == (0.0, False)


def test_a_stop_fades_and_is_safe_when_it_is_dark() -> None:
    state = ShowState().to(GOING, 0.0, NOW, 2.0)
    assert [state.level(NOW + t) for t in (0.0, 0.5, 1.0, 2.0, 9.0)] == [1.0, 0.75, 0.5, 0.0, 0.0]
    assert [state.is_safe(NOW + t) for t in (0.0, 1.9, 2.0)] == [False, False, True]


def test_a_number_fades_from_where_it_is() -> None:
    state = ShowState().to(MASTER, 0.0, NOW, 10.0)
    assert state.level(NOW + 4.0) == pytest.approx(0.6)
    state = state.to(MASTER, 1.0, NOW + 4.0, 2.0)
    assert state.level(NOW + 4.0) == pytest.approx(0.6)
    assert state.level(NOW + 5.0) == pytest.approx(0.8)
    assert state.to(MASTER, 0.3, NOW + 5.0).level(NOW + 5.0) == 0.3


def test_a_name_that_is_left_before_it_was_there_is_left_from_what_is_seen_most() -> None:
    for lever, first, second in ((LOOK, "ink", "lines"), (CARD, "title", ""), (LIGHTS, "cold", "warm")):
        state = ShowState().to(lever, first, NOW, 2.0)
        assert state[lever] == Fade(first, "", NOW, 2.0) and state[lever].share(NOW + 0.5) == 0.25
        assert state.to(lever, second, NOW + 0.5, 2.0)[lever].before == ""
        assert state.to(lever, second, NOW + 1.5, 2.0)[lever].before == first
    turned = ShowState().to(CAMERA, {"angle_deg": 90.0}, NOW, 2.0)
    assert turned.to(CAMERA, {}, NOW + 1.5, 2.0)[CAMERA].before == {"angle_deg": 90.0}
    assert turned.for_show("another")[CAMERA].value == {}


def test_what_began_in_the_future_is_over() -> None:
    """The monotonic clock starts anew with the machine; a folder on a disk may outlive that."""
    state = ShowState().to(GOING, 0.0, NOW, 2.0).to(MASTER, 0.4, NOW, 5.0)
    settled = state.settled(3.0)
    assert settled.is_safe(3.0)
    assert settled[MASTER].level(3.0) == 0.4
    assert state.settled(NOW + 1.0) == state


def test_what_the_dance_follows_has_a_generation_that_grows() -> None:
    state = ShowState().to(LOOK, "ink", NOW)
    assert state.generation == state[LOOK].generation == 0
    one = state.changed(NOW, [Change(PHRASE, "slow"), Change(hand("Chest"), False), Change(LOOK, "lines")])
    assert one.generation == one[PHRASE].generation == one[hand("Chest")].generation == int(1e9 * NOW)
    again = one.to(PHRASE, "slow", NOW)
    assert again[PHRASE].generation == again.generation == one.generation + 1
    assert list(again.settings)[-1] == "phrase", "the newest comes last"


def test_another_setting_of_the_springs_ends_its_knobs() -> None:
    blown = ShowState().to(STORM, 0.5).to(WIND, (1.0, 2.0, 3.0))
    assert blown[WIND].value == (1.0, 2.0, 3.0)
    calm = blown.to(SPRINGS, "loose")
    assert STORM not in calm and WIND not in calm and SPRINGS in calm


def test_another_show_begins_in_the_same_light() -> None:
    state = ShowState(True, show="one").to(LOOK, "ink").to(MASTER, 0.5).to(CUE, "1").to(PHRASE, "slow")
    other = state.for_show("other")
    assert (other.panic, other[LOOK].value, other[MASTER].value) == (True, "ink", 0.5)
    assert (other.cue, PHRASE in other, state.for_show("one")) == ("", False, state)


def test_every_lever_comes_back_from_the_file_and_from_an_order_as_it_was() -> None:
    values = {
        **{lever.name: lever.default for lever in LEVERS if lever.name != "hand"},
        "camera": {"angle_deg": 90.0, "move": "orbit"},
        "iterations": (12, 11),
        "rate": -1.5,
        "wind": (1.0, -2.0, 0.5),
        "motion path points": (0.25, 0.75),
        "look": "Bütö ink",
    }
    state = ShowState(blackout=True, show="A show").to(hand("lShldr"), False, NOW)
    for name, value in values.items():
        lever = find_lever(name)
        assert lever is not None
        state = state.to(lever, value, NOW, 3.0)
        if lever is not CAMERA:
            given, seconds = lever.given(*lever.formatted(state[lever]))
            assert given == value and type(given) is type(value)
            assert seconds == (0.0 if lever.fade_s is None else 3.0)
    assert unpacked(packed(state)) == state
    assert find_lever("of the next release") is None


@pytest.mark.parametrize(
    ("payload", "read"),
    [
        (b'{"panic": true, "mood": "dark"}', ShowState(panic=True)),
        (b'{"settings": {"mood": ["dark", "", 0, 0, 0]}}', ShowState()),
        (b'{"settings": {"look": [["ink"], "", 0, 0, 0]}}', ShowState()),
        (b"not json", ShowState()),
        (b"[1]", ShowState()),
        (b"", ShowState()),
    ],
)
def test_of_another_release_what_both_know_counts(payload: bytes, read: ShowState) -> None:
    assert unpacked(payload) == read


def test_a_show_state_of_0_1_is_read_without_its_fades_and_its_dance() -> None:
    before = {
        "panic": True,
        "blackout": False,
        "going": False,
        "going_since": 5.0,
        "going_fade_s": 2.0,
        "master": 0.5,
        "master_before": 1.0,
        "look": "ink",
        "look_before": "",
        "card": "",
        "cue": "storm",
        "camera": {"angle_deg": 30.0},
        "show": "A show",
        "generation": 77,
        "dance": {"iterations": [77, "", [6.0, 5.0]], "rate": [77, "", []]},
    }
    state = unpacked(json.dumps(before).encode())
    assert (state.panic, state.going, state.cue, state.show, state.generation) == (
        *(True, False, "storm", "A show", 77),
    )
    assert (state[MASTER].value, state[LOOK].value, state[CAMERA].value) == (0.5, "ink", {"angle_deg": 30.0})
    assert ITERATIONS not in state and RATE not in state


def test_defaults_are_of_the_kind_of_their_levers() -> None:
    for lever in LEVERS:
        assert lever.kind.plain(lever.default) == lever.default
    assert MADE_NUMBERS["vary"]["sigma"].default == 0.7
    assert PATH_POINTS.default == ()
