"""Show control over its real port: what each command does, and what its sender is answered."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from appliance.box.orders import Order
from appliance.box.roster import RosterLine
from appliance.levers.addresses import ADDRESSES
from appliance.levers.lever import Lever
from appliance.levers.show_state import ShowState
from appliance.levers.table import (
    CAMERA,
    CARD,
    CUE,
    GOING,
    ITERATIONS,
    LIGHTS,
    LIVELINESS,
    LOOK,
    MASTER,
    PHRASE,
    RATE,
    SEED,
    hand,
)
from appliance.sensor.keys import create_keys, load_keys
from appliance.show_control.show_state_commands import OWN
from tests.show_control.doubles import Asker, ControlInThread, InboxDouble, StageDouble, until
from tests.show_control.in_force import declared, show_state


def faded(folder: Path, lever: Lever[Any]) -> tuple[Any, Any, float]:
    """From where to where, in how long."""
    fade = show_state(folder)[lever]
    return fade.value, fade.before, fade.seconds


def test_ping(asker: Asker) -> None:
    assert asker.ask("/ping") == ["/pong"]


def test_master_look_and_lights_fade(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/master", 0.25, 5)
    asker.ask("/look", "ink", 4)
    asker.ask("/lights", "cold")
    assert faded(folder, MASTER) == (0.25, 1.0, 5.0)
    assert faded(folder, LOOK) == ("ink", "", 4.0)
    assert faded(folder, LIGHTS) == ("cold", "", 2.0)


def test_cards_and_the_camera_come_and_go_with_fades(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/card", "blank", 3)[2] == 1
    assert faded(folder, CARD) == ("blank", "", 3.0)
    off, on, end = asker.ask_all("/cards")
    assert (off, on, end) == (["/cards/card", "none", 0], ["/cards/card", "blank", 1], ["/end", "/cards", 2])
    asker.ask("/card", "none")
    assert declared(folder, CARD) == ("", 2.0)
    assert asker.ask("/camera", 90, 20, 0.4, 5)[2] == 1
    assert declared(folder, CAMERA) == (
        {"angle_deg": 90.0, "elevation_deg": 20.0, "figure": pytest.approx(0.4)},
        5.0,
    )
    assert "figure (0.1 to 0.9)" in asker.ask("/camera", 90, 20, 3)[3]
    asker.ask("/camera/look", 1)
    assert declared(folder, CAMERA) == ({}, 1.0)


@pytest.mark.parametrize(
    ("message", "cure"),
    [
        (("/look", "plastr"), "Did you mean 'plaster'?"),
        (("/lights", "Colt"), "Did you mean 'cold'?"),
        (("/cue", "strom"), "Did you mean 'storm'?"),
        (("/phrase", "quite"), "Did you mean 'quiet'?"),
        (("/cue", "zzz"), "Known: 1, storm."),
        (("/pannic",), "Did you mean /panic?"),
        (("/master", 7), "/master takes brightness (0 to 1)"),
    ],
)
def test_what_is_misspelt_changes_nothing_and_the_nearest_is_named(
    folder: Path, stage: StageDouble, asker: Asker, message: tuple[str], cure: str
) -> None:
    address, about, done, text = asker.ask(*message)
    assert (address, about, done) == ("/reply", message[0], 0)
    assert cure in text
    now = show_state(folder)
    assert not now.settings and now.generation == 0 and not now.panic
    assert stage.orders == []


def test_names_without_a_stage_are_refused_in_words(asker: Asker) -> None:
    assert "No stage has danced on this box yet" in asker.ask("/look", "ink")[3]
    for message in (("/cue",), ("/hold", "lShldr", 1), ("/iterations", 3, 2), ("/player/stop",)):
        assert "nothing is changed. Start it: bunraku play" in asker.ask(*message)[3]


@pytest.mark.parametrize(
    ("message", "lever", "wanted"),
    [
        (("/phrase", "quiet"), PHRASE, ("quiet", 2.0)),
        (("/phrase", "quiet", 0), PHRASE, ("quiet", 0.0)),
        (("/iterations", 12, 11), ITERATIONS, ((12, 11), 0.0)),
    ],
)
def test_what_persists_of_the_dance_is_declared_and_answered_when_the_stage_follows(
    folder: Path,
    stage: StageDouble,
    asker: Asker,
    message: tuple[str],
    lever: Lever[Any],
    wanted: tuple[object, ...],
) -> None:
    stage.remark = "So it is."
    assert asker.ask(*message) == ["/reply", message[0], 1, "So it is."]
    assert declared(folder, lever) == wanted
    assert stage.orders == []


def test_how_alive_and_which_dance_is_declared(folder: Path, stage: StageDouble, asker: Asker) -> None:
    text = "The liveliness goes to 50 %."
    assert asker.ask("/liveliness", 0.5, 3) == ["/reply", "/liveliness", 1, text]
    assert declared(folder, LIVELINESS) == (0.5, 3.0)
    text = "The answer goes over to the seed 2147483647."
    assert asker.ask("/seed", 2**31 - 1) == ["/reply", "/seed", 1, text]
    assert declared(folder, SEED) == (2**31 - 1, 0.0)
    stage.tell(liveliness=0.75, seed=5)
    assert (asker.status().liveliness, asker.status().seed) == (0.75, 5)


def test_hands_are_declared_by_name_or_number(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/hold", "lShldr", 0) == ["/reply", "/hold", 1, "The hand of lShldr lets go."]
    assert declared(folder, hand("lShldr")) == (False, 0.0)
    assert asker.ask("/hold", 2, 1) == ["/reply", "/hold", 1, "The hand of lShldr holds."]
    assert declared(folder, hand("lShldr")) == (True, 0.0)
    assert "Did you mean 'lShldr'?" in asker.ask("/hold", "lSholder", 1)[3]
    assert "No hand of this show holds 'Chest'" in asker.ask("/hold", "Chest", 1)[3]
    assert "There is no joint 99" in asker.ask("/hold", 99, 1)[3]
    assert list(show_state(folder).settings) == ["hand lShldr"]


@pytest.mark.parametrize(
    ("message", "order"),
    [
        (("/sensors/neutral", "left-wrist"), Order("neutral", (), "left-wrist")),
        (("/sensors/heading",), Order("heading")),
        (("/sensors/strobe", "left-wrist"), Order("strobe", (), "left-wrist")),
    ],
)
def test_what_happens_once_is_the_stages_and_it_answers(
    stage: StageDouble, asker: Asker, message: tuple[str], order: Order
) -> None:
    assert asker.ask(*message) == ["/sensors/reply", message[0], 1, f"{order.name} it is."]
    assert stage.orders == [order]


def test_streams_are_answered_when_refused_alone(folder: Path, stage: StageDouble, asker: Asker) -> None:
    stage.answer = lambda order: (order.name != "jump", "No.")
    asker.tell("/player/start")
    asker.tell("/player/excerpt", 1.0)
    asker.tell("/mocap/setjointrot", "lShldr", 0.0, 1.0, 0.0, 1.5)
    assert asker.ask("/player/jump", 12.5) == ["/reply", "/player/jump", 0, "No."]
    asker.tell("/mocap/releasejoint", 2)
    asker.tell("/player/rate", -1)
    assert asker.ask("/player/rate", 5)[3] == "/player/rate takes rate (-4 to 4)."
    until(lambda: len(stage.orders) == 4)
    assert [order.name for order in stage.orders] == ["excerpt", "hold", "jump", "release"]
    assert stage.orders[-1].text == "lShldr"
    assert declared(folder, RATE) == (-1.0, 0.0)
    asker.tell("/player/stop")
    until(lambda: declared(folder, RATE) == (0.0, 0.0))
    stage.obeys = False
    assert asker.ask("/ping") == ["/pong"]


def test_the_projector_has_orders_of_its_own(folder: Path, asker: Asker) -> None:
    assert "No projector runs on this box" in asker.ask("/projector/grid", 1)[3]
    projector = InboxDouble(folder, "projector")
    corners = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]
    for message in (
        *(("/projector/corner", 1, 0.25, 0.5), ("/projector/corners", *corners)),
        *(("/projector/corners/reset",), ("/projector/brightness", 0.5)),
        *(("/projector/mirror", 1), ("/projector/grid", 1), ("/projector/info", 0)),
    ):
        assert asker.ask(*message)[:3] == ["/reply", message[0], 1]
    projector.close()
    assert projector.orders == [
        Order("corner", (1.0, 0.25, 0.5)),
        Order("corners", tuple(corners)),
        Order("corners/reset"),
        Order("brightness", (0.5,)),
        Order("mirror", (1.0,)),
        Order("grid", (1.0,)),
        Order("info", (0.0,)),
    ]


def test_questions_are_answered_with_what_is_in_force(stage: StageDouble, asker: Asker) -> None:
    stage.tell(phrase="quiet", let_go=["lShldr"])
    assert asker.ask("/cue", "storm")[2] == 1
    assert asker.ask_all("/cues") == [["/cues/cue", "1", 0], ["/cues/cue", "storm", 1], ["/end", "/cues", 2]]
    assert asker.ask_all("/phrases")[:2] == [["/phrases/phrase", "main", 0], ["/phrases/phrase", "quiet", 1]]
    looks = asker.ask_all("/looks")
    assert [look[1:] for look in looks[:-1]] == [["plaster", 0], ["lines", 0], ["ink", 1], ["cloud", 0]]
    assert asker.ask_all("/hands") == [
        ["/hands/hand", "lShldr", "left-wrist", 0, "orientation"],
        ["/end", "/hands", 1],
    ]


def test_questions_without_a_stage_have_empty_answers(asker: Asker) -> None:
    for question in ("/cues", "/phrases", "/looks", "/hands"):
        assert asker.ask_all(question) == [["/end", question, 0]]
    *status, end = asker.ask_all("/status")
    assert status[0] == ["/bunraku/status/state", "absent"]
    assert end == ["/end", "/status", len(status)]


def test_reasons_may_be_shown_on_any_terminal(control: ControlInThread, asker: Asker) -> None:
    asker.tell("/\x1b]0;mine\x07\x9b31m")
    assert asker.ask("/ping") == [
        "/reply",
        "/\x1b]0;mine\x07\x9b31m",
        0,
        "A command has no control characters in it.",
    ]
    assert control.process.handler.reason.isprintable()
    assert control.process.conclusion().startswith("Commands: 1 refused, the last one: A command has no")


def test_two_show_controls_do_not_share_a_folder(folder: Path, control: ControlInThread) -> None:
    with pytest.raises(OSError, match="unavailable"):
        ControlInThread(folder)


def test_each_command_is_carried_out_somewhere() -> None:
    declared = {address for address, one in ADDRESSES.items() if one.lever} | set(OWN)
    orders = {address for address, one in ADDRESSES.items() if one.order}
    gestures = {address for address in ADDRESSES if address.startswith("/gesture/")}  # test_gestures.py
    assert set(ADDRESSES) == {"/ping", "/sensors/list"} | declared | orders | gestures
    assert not declared & orders


def shown(now: ShowState) -> tuple[str, str, str, float]:
    return now.cue, now[LOOK].value, now[LIGHTS].value, now[MASTER].value


def test_a_cue_declares_picture_lights_and_dance_and_is_answered_when_the_dance_follows(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    stage.remark = "At most 8 iterations fit."
    assert asker.ask("/cue", "storm") == ["/reply", "/cue", 1, "Cue storm. At most 8 iterations fit."]
    now = show_state(folder)
    assert shown(now) == ("storm", "ink", "cold", 0.5)
    assert (now[CARD].value, now[CAMERA].value) == ("blank", {"angle_deg": 30.0})
    assert [now[lever].seconds for lever in (LOOK, LIGHTS, MASTER)] == [4.0, 4.0, 4.0]
    assert declared(folder, PHRASE) == ("quiet", 4.0)
    assert declared(folder, hand("lShldr")) == (False, 0.0)
    assert declared(folder, ITERATIONS) == ((12, 11), 4.0)
    assert declared(folder, LIVELINESS) == (0.25, 4.0)
    assert declared(folder, SEED) == (7, 0.0)
    before = now.settings
    assert asker.ask("/cue", 1)[2] == 1
    now = show_state(folder)
    assert shown(now) == ("1", "lines", "cold", 0.5)
    assert declared(folder, CUE) == ("1", 0.0)
    assert {name for name in before if now.settings[name] != before[name]} == {"cue", "look"}


def test_a_command_again_is_declared_again(folder: Path, stage: StageDouble, asker: Asker) -> None:
    """A phrase of which a part plays goes back to the whole phrase."""
    generations = []
    for message in (("/phrase", "quiet"), ("/phrase", "quiet"), ("/cue", "storm"), ("/cue", "storm")):
        assert asker.ask(*message)[2] == 1
        generations.append(show_state(folder)[PHRASE].generation)
    assert generations == sorted(set(generations))


def test_what_is_said_after_a_cue_wins_over_it(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/look", "lines")
    asker.tell("/cue", "storm")
    asker.tell("/master", 0.25)
    asker.tell("/cue", "1")
    assert {asker.hear()[1] for _ in range(4)} == {"/look", "/cue", "/master"}  # type: ignore[index]
    now = show_state(folder)
    assert shown(now) == ("1", "lines", "cold", 0.25)


def test_cues_follow_each_other(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert [asker.ask("/cue")[3] for _ in range(2)] == ["Cue 1.", "Cue storm."]
    _, _, done, message = asker.ask("/cue")
    assert not done
    assert "storm was the last cue" in message
    assert show_state(folder).cue == "storm"


def test_panic_is_in_force_when_the_reply_comes_and_go_lifts_it(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    for command, lifting in ((["/panic"], ["/go"]), (["/panic", 1.0], ["/go", 1.0])):
        address, about, done, message = asker.ask(*command)
        assert (address, about, done) == ("/reply", "/panic", 1)
        assert "/go lifts it" in message
        assert show_state(folder).panic
        assert show_state(folder).level(time.monotonic()) == 0.0
        assert asker.ask(*lifting)[2] == 1
        assert not show_state(folder).panic
    assert show_state(folder).going


def test_a_button_let_go_changes_nothing_and_is_not_refused(
    control: ControlInThread, folder: Path, stage: StageDouble, asker: Asker
) -> None:
    asker.ask("/stop", 60.0)
    fade = show_state(folder)[GOING]
    assert "runs on" in asker.ask("/stop", 0.0)[3]
    assert show_state(folder)[GOING] == fade and fade.seconds == 60.0
    asker.ask("/panic", 1.0)
    address, about, done, message = asker.ask("/panic", 0.0)
    assert (address, about, done) == ("/reply", "/panic", 0)
    assert "let go" in message and "/go lifts a panic" in message
    assert "let go" in asker.ask("/go", 0.0)[3]
    assert show_state(folder).panic and not show_state(folder).going
    assert control.process.handler.refused == 0


def test_after_go_picture_and_lights_come_back_slowly(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/panic")
    asker.ask("/go")
    since = show_state(folder)[GOING].since
    assert [show_state(folder).level(since + t) for t in (0.0, 0.5, 1.0)] == [0.0, 0.5, 1.0]


def test_panic_needs_no_stage(folder: Path, asker: Asker) -> None:
    assert asker.ask("/panic")[2] == 1
    assert show_state(folder).panic


def test_a_slow_stop_can_be_made_a_quick_one(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/stop", 60.0)[2] == 1
    assert not show_state(folder).is_safe(time.monotonic() + 1.0)
    assert asker.ask("/stop", 0.1)[2] == 1
    assert show_state(folder).is_safe(time.monotonic() + 0.1)


def test_stop_fades_then_the_phrase_stands_until_go(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/stop", 0.3)[2] == 1
    stopped = show_state(folder)
    assert not stopped.going
    assert [stopped.stands(stopped[GOING].since + t) for t in (0.0, 0.29, 0.31)] == [False, False, True]
    until(lambda: asker.ask("/stop")[3].startswith("The show stands still already"))
    assert asker.ask("/go")[2] == 1
    assert show_state(folder).going and not show_state(folder).stands(time.monotonic())


def test_after_go_the_phrase_plays_at_the_shows_rate(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/player/rate", 2.0)
    until(lambda: declared(folder, RATE) == (2.0, 0.0))
    asker.ask("/go")
    assert declared(folder, RATE) == (2.0, 0.0)  # it goes on already
    asker.ask("/stop", 0)
    asker.ask("/go")
    assert declared(folder, RATE) == (None, 0.0)
    asker.tell("/player/stop")
    until(lambda: declared(folder, RATE) == (0.0, 0.0))
    asker.ask("/go")
    assert declared(folder, RATE) == (None, 0.0)


def test_go_starts_a_show_that_stands_by_itself(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/go")
    assert declared(folder, RATE) is None
    stage.tell(state="stopped")
    until(lambda: asker.ask("/go")[2] == 1 and declared(folder, RATE) is not None)
    assert declared(folder, RATE) == (None, 0.0)


def test_blackout_is_dark_without_panic_and_go_does_not_lift_it(folder: Path, asker: Asker) -> None:
    assert asker.ask("/blackout", 1)[2] == 1
    assert show_state(folder).level(time.monotonic()) == 0.0
    assert not show_state(folder).is_safe(time.monotonic())
    assert "/blackout 0" in asker.ask("/go")[3]
    assert show_state(folder).blackout
    asker.ask("/blackout", 0)
    assert not show_state(folder).blackout


def test_the_roster_is_told_as_the_stage_saw_it_last(
    stage: StageDouble, asker: Asker, key_file: Path
) -> None:
    line = ["left-wrist", "1a2b3c4d", "linked", "10.0.0.7:2390", 50.0, 0.5, 0.25, -1.0, 87, 51, 1]
    rest = ["1.0.0", "00112233445566778899aabbccddeeff", "taken", "", 0.0, -1.0]
    stage.tell(sensors=[line + rest, line], looked_at=time.monotonic() - 5.0)
    sensor, end = asker.ask_all("/sensors/list")
    assert sensor == ["/sensors/sensor", *line, *rest]  # not the line of another release
    assert end[:2] == ["/sensors/end", 1]
    assert 5.0 <= end[2] < 65.0
    assert end[3] == str(key_file)
    stage.tell(looked_at=time.monotonic() + 60.0)  # after show control, held up for a moment, read its clock
    assert asker.ask_all("/sensors/list")[-1][2] == 0.0


def test_the_page_on_osc_has_the_type_tags_of_a_sensor() -> None:
    tags = {str: "s", float: "f", int: "i"}
    kinds = "".join(tags[kind] for kind in get_type_hints(RosterLine).values())
    page = Path(__file__).resolve().parents[2] / "docs" / "osc.md"
    assert f"| `/sensors/sensor` | `,{kinds}` |" in page.read_text("utf-8")


def test_the_roster_of_a_box_that_is_starting_and_of_none(folder: Path, key_file: Path, asker: Asker) -> None:
    [reply] = asker.ask_all("/sensors/list")
    assert reply[:3] == ["/sensors/reply", "/sensors/list", 0]
    assert "No stage dances on this box" in reply[3]
    with StageDouble(folder):
        until(lambda: asker.ask_all("/sensors/list") == [["/sensors/end", 0, -1.0, str(key_file)]])


def test_a_reload_brings_the_keys_along(stage: StageDouble, asker: Asker, key_file: Path) -> None:
    assert asker.ask("/sensors/reload") == ["/sensors/reply", "/sensors/reload", 1, "reload it is."]
    [order] = stage.orders
    assert order.keys == {name: (one.device_id, one.key) for name, one in load_keys(key_file).items()}
    key_file.unlink()
    create_keys(key_file, ["left-wrist", "spare-1", "spare-2"])
    asker.ask("/sensors/reload")
    assert len(stage.orders[-1].keys) == 3


def test_a_key_file_that_has_not_changed_is_not_read_again(
    stage: StageDouble, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[Path] = []

    def read(path: Path) -> dict[str, object]:
        reads.append(path)
        return dict(load_keys(path))

    monkeypatch.setattr("appliance.sensor.keys.load_keys", read)
    for _ in range(5):
        asker.ask("/sensors/reload")
    assert (len(reads), len(stage.orders)) == (1, 5)


@pytest.mark.parametrize(
    ("text", "complaint"), [("left-wrist: {", "not valid YAML here"), (None, "No such file")]
)
def test_a_reload_of_a_bad_file_changes_nothing_and_is_told(
    stage: StageDouble, asker: Asker, key_file: Path, text: str | None, complaint: str
) -> None:
    key_file.write_text(text) if text is not None else key_file.unlink()
    _, about, done, message = asker.ask("/sensors/reload")
    assert (about, done) == ("/sensors/reload", 0)
    assert complaint in message
    assert "goes on with the keys that it has" in message
    assert stage.orders == []


def test_a_box_without_a_key_file_says_so(folder: Path) -> None:
    control = ControlInThread(folder)
    asker = Asker(control.port)
    assert "no key file" in asker.ask("/sensors/reload")[3]
    asker.close()
    control.close()
