"""Show control over its real port: what each command does, and what comes back to whoever sent it."""

from __future__ import annotations

import threading
import time
from contextlib import closing
from pathlib import Path

import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from appliance.box.show_state import ShowState, ShowStateReader, ShowStateWriter
from appliance.sensor.keys import create_keys, load_keys
from appliance.show_control import order_dispatch
from appliance.show_control.command import FORMS
from appliance.show_control.command_handler import ORDERS
from appliance.show_control.orders import Order
from appliance.show_control.show_state_commands import DECLARATIONS
from appliance.show_control.status_messages import QUESTIONS
from tests.show_control.doubles import Asker, ControlInThread, InboxDouble, StageDouble, facts, until


def show_state(folder: Path) -> ShowState:
    return ShowStateReader(folder).read()


def declared(folder: Path, part: str) -> tuple[object, ...]:
    """What is declared for a part of the dance: a text, and numbers; nothing before it is."""
    _, text, numbers = show_state(folder).dance.get(part, (0, "", ()))
    return (text, *numbers) if part in show_state(folder).dance else ()


def test_ping(asker: Asker) -> None:
    assert asker.ask("/ping") == ["/pong"]


def test_panic_is_in_force_when_the_reply_comes_and_go_lifts_it(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    for command, lifting in ((["/panic"], ["/go"]), (["/panic", 1.0], ["/go", 1.0])):
        address, about, done, words = asker.ask(*command)
        assert (address, about, done) == ("/reply", "/panic", 1)
        assert "/go lifts it" in words
        assert show_state(folder).panic
        assert show_state(folder).level(time.monotonic()) == 0.0
        assert asker.ask(*lifting)[2] == 1
        assert not show_state(folder).panic
    assert show_state(folder).going


def test_a_button_let_go_changes_nothing_and_is_not_refused(
    control: ControlInThread, folder: Path, stage: StageDouble, asker: Asker
) -> None:
    asker.ask("/stop", 60.0)
    since = show_state(folder).going_since
    assert "runs on" in asker.ask("/stop", 0.0)[3]
    assert (show_state(folder).going_since, show_state(folder).going_fade_s) == (since, 60.0)
    asker.ask("/panic", 1.0)
    address, about, done, words = asker.ask("/panic", 0.0)
    assert (address, about, done) == ("/reply", "/panic", 0)
    assert "let go" in words and "/go lifts a panic" in words
    assert "let go" in asker.ask("/go", 0.0)[3]
    assert show_state(folder).panic and not show_state(folder).going
    assert control.process.handler.refused == 0


def test_after_go_picture_and_lights_come_back_slowly(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/panic")
    asker.ask("/go")
    since = show_state(folder).going_since
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
    assert [stopped.stands(stopped.going_since + t) for t in (0.0, 0.29, 0.31)] == [False, False, True]
    until(lambda: asker.ask("/stop")[3].startswith("The show stands still already"))
    assert asker.ask("/go")[2] == 1
    assert show_state(folder).going and not show_state(folder).stands(time.monotonic())


def test_after_go_the_phrase_plays_at_the_shows_rate(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/player/rate", 2.0)
    until(lambda: declared(folder, "rate") == ("", 2.0))
    asker.ask("/go")
    assert declared(folder, "rate") == ("", 2.0)  # it goes on already
    asker.ask("/stop", 0)
    asker.ask("/go")
    assert declared(folder, "rate") == ("",)
    asker.tell("/player/stop")
    until(lambda: declared(folder, "rate") == ("", 0.0))
    asker.ask("/go")
    assert declared(folder, "rate") == ("",)


def test_go_starts_a_show_that_stands_by_itself(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/go")
    assert declared(folder, "rate") == ()
    stage.tell(state="stopped")
    until(lambda: asker.ask("/go")[2] == 1 and declared(folder, "rate") != ())
    assert declared(folder, "rate") == ("",)


def test_blackout_is_dark_without_panic_and_go_does_not_lift_it(folder: Path, asker: Asker) -> None:
    assert asker.ask("/blackout", 1)[2] == 1
    assert show_state(folder).level(time.monotonic()) == 0.0
    assert not show_state(folder).is_safe(time.monotonic())
    assert "/blackout 0" in asker.ask("/go")[3]
    assert show_state(folder).blackout
    asker.ask("/blackout", 0)
    assert not show_state(folder).blackout


def test_master_look_and_lights_fade(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/master", 0.25, 5)
    asker.ask("/look", "ink", 4)
    asker.ask("/lights", "cold")
    now = show_state(folder)
    assert (now.master, now.master_before, now.master_fade_s) == (0.25, 1.0, 5.0)
    assert (now.look, now.look_before, now.look_fade_s) == ("ink", "", 4.0)
    assert (now.lights, now.lights_before, now.lights_fade_s) == ("cold", "", 2.0)


def test_cards_and_the_camera_come_and_go_with_fades(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/card", "blank", 3)[2] == 1
    now = show_state(folder)
    assert (now.card, now.card_before, now.card_fade_s) == ("blank", "", 3.0)
    off, on, end = asker.ask_all("/cards")
    assert (off, on, end) == (["/cards/card", "none", 0], ["/cards/card", "blank", 1], ["/end", "/cards", 2])
    asker.ask("/card", "none")
    assert (show_state(folder).card, show_state(folder).card_fade_s) == ("", 2.0)
    assert asker.ask("/camera", 90, 20, 0.4, 5)[2] == 1
    now = show_state(folder)
    assert (now.camera, now.camera_fade_s) == (
        {"angle_deg": 90.0, "elevation_deg": 20.0, "figure": pytest.approx(0.4)},
        5.0,
    )
    assert "figure (0.1 to 0.9)" in asker.ask("/camera", 90, 20, 3)[3]
    asker.ask("/camera/look", 1)
    assert (show_state(folder).camera, show_state(folder).camera_fade_s) == ({}, 1.0)


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
    address, about, done, words = asker.ask(*message)
    assert (address, about, done) == ("/reply", message[0], 0)
    assert cure in words
    now = show_state(folder)
    assert now in (ShowState(), ShowState(show="A test")) and now.generation == 0
    assert stage.orders == []


def test_names_without_a_stage_are_refused_in_words(asker: Asker) -> None:
    assert "No stage has danced on this box yet" in asker.ask("/look", "ink")[3]
    for message in (("/cue",), ("/hold", "lShldr", 1), ("/iterations", 3, 2), ("/player/stop",)):
        assert "nothing is changed. Start it: bunraku play" in asker.ask(*message)[3]


def test_a_cue_declares_picture_lights_and_dance_and_is_answered_when_the_dance_follows(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    stage.remark = "At most 8 iterations fit."
    assert asker.ask("/cue", "storm") == ["/reply", "/cue", 1, "Cue storm. At most 8 iterations fit."]
    now = show_state(folder)
    assert (now.cue, now.look, now.lights, now.master) == ("storm", "ink", "cold", 0.5)
    assert (now.card, now.camera) == ("blank", {"angle_deg": 30.0})
    assert (now.look_fade_s, now.lights_fade_s, now.master_fade_s) == (4.0, 4.0, 4.0)
    assert declared(folder, "phrase") == ("quiet", 4.0)
    assert declared(folder, "hand lShldr") == ("lShldr", 0.0)
    assert declared(folder, "iterations") == ("", 12.0, 11.0, 4.0)
    dance = {**now.dance}
    assert asker.ask("/cue", 1)[2] == 1
    now = show_state(folder)
    assert (now.cue, now.look, now.lights, now.master) == ("1", "lines", "cold", 0.5)
    assert declared(folder, "cue") == ("1",)
    assert {**now.dance, "cue": dance["cue"]} == dance  # what it leaves out stays


def test_a_command_again_is_declared_again(folder: Path, stage: StageDouble, asker: Asker) -> None:
    """A phrase of which a part plays goes back to the whole phrase."""
    generations = []
    for message in (("/phrase", "quiet"), ("/phrase", "quiet"), ("/cue", "storm"), ("/cue", "storm")):
        assert asker.ask(*message)[2] == 1
        generations.append(show_state(folder).dance["phrase"][0])
    assert generations == sorted(set(generations))


def test_after_a_power_cut_picture_and_lights_are_those_of_the_stages_cue(folder: Path) -> None:
    """Memory is empty, and the stage has found in the disk's place in which cue it was."""
    with StageDouble(folder) as stage:
        stage.tell(cue="storm")
        control = ControlInThread(folder)
        until(lambda: show_state(folder).cue == "storm")
        now = show_state(folder)
        assert (now.look, now.lights, now.master) == ("ink", "cold", 1.0)
        assert now.look_mix(time.monotonic()) == 1.0
        control.close()


def test_after_a_power_cut_the_springs_are_those_of_the_stages_cue(folder: Path) -> None:
    show = facts(cues=({"name": "gale", "springs": "storm", "fade_s": 2.0},), springs=("loose", "storm"))
    with StageDouble(folder, show) as stage:
        stage.tell(cue="gale")
        control = ControlInThread(folder)
        until(lambda: show_state(folder).cue == "gale")
        assert show_state(folder).dance["springs"][1] == "storm"
        control.close()


@pytest.mark.parametrize(
    ("left", "cue"),
    [(ShowState(cue="1", look="lines", show="A test"), "storm"), (ShowState(), "of another")],
)
def test_what_is_in_force_stays_whatever_the_stages_cue(folder: Path, left: ShowState, cue: str) -> None:
    with closing(ShowStateWriter(folder)) as writer:
        writer.write(left)
    with StageDouble(folder) as stage:
        stage.tell(cue=cue)
        control = ControlInThread(folder)
        asker = Asker(control.port)
        until(lambda: control.process.handler.status(0, time.monotonic()).state == "dancing")
        asker.ask("/ping")
        assert (show_state(folder).cue, show_state(folder).look) == (left.cue, left.look)
        asker.close()
        control.close()


@pytest.mark.parametrize("lives", [True, False])
def test_what_is_declared_while_the_stage_is_away_is_in_force_and_the_reply_says_so(
    folder: Path, stage: StageDouble, asker: Asker, monkeypatch: pytest.MonkeyPatch, lives: bool
) -> None:
    monkeypatch.setattr(order_dispatch, "PATIENCE_S", 0.3)
    assert asker.ask("/cue", "1")[2] == 1
    stage.obeys = False
    if not lives:
        stage.__exit__(None, None, None)
        until(lambda: asker.ask_all("/status")[0][1] == "absent")
    words = "does not answer. The dance follows" if lives else "The dance begins with this"
    reply = asker.ask("/cue", "storm")
    assert reply[:3] == ["/reply", "/cue", 0] and words in reply[3]
    assert show_state(folder).cue == "storm" and declared(folder, "phrase") == ("quiet", 4.0)


def test_what_is_said_after_a_cue_wins_over_it(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/look", "lines")
    asker.tell("/cue", "storm")
    asker.tell("/master", 0.25)
    asker.tell("/cue", "1")
    assert {asker.hear()[1] for _ in range(4)} == {"/look", "/cue", "/master"}  # type: ignore[index]
    now = show_state(folder)
    assert (now.cue, now.look, now.lights, now.master) == ("1", "lines", "cold", 0.25)


def test_cues_follow_each_other(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert [asker.ask("/cue")[3] for _ in range(2)] == ["Cue 1.", "Cue storm."]
    _, _, done, words = asker.ask("/cue")
    assert not done
    assert "storm was the last cue" in words
    assert show_state(folder).cue == "storm"


@pytest.mark.parametrize(
    ("message", "part", "wanted"),
    [
        (("/phrase", "quiet"), "phrase", ("quiet", 2.0)),
        (("/phrase", "quiet", 0), "phrase", ("quiet", 0.0)),
        (("/iterations", 12, 11), "iterations", ("", 12.0, 11.0)),
    ],
)
def test_what_persists_of_the_dance_is_declared_and_answered_when_the_stage_follows(
    folder: Path, stage: StageDouble, asker: Asker, message: tuple[str], part: str, wanted: tuple[object, ...]
) -> None:
    stage.remark = "So it is."
    assert asker.ask(*message) == ["/reply", message[0], 1, "So it is."]
    assert declared(folder, part) == wanted
    assert stage.orders == []


def test_hands_are_declared_by_name_or_number(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/hold", "lShldr", 0) == ["/reply", "/hold", 1, "The hand of lShldr lets go."]
    assert declared(folder, "hand lShldr") == ("lShldr", 0.0)
    assert asker.ask("/hold", 2, 1) == ["/reply", "/hold", 1, "The hand of lShldr holds."]
    assert declared(folder, "hand lShldr") == ("lShldr", 1.0)
    assert "Did you mean 'lShldr'?" in asker.ask("/hold", "lSholder", 1)[3]
    assert "No hand of this show holds 'Chest'" in asker.ask("/hold", "Chest", 1)[3]
    assert "There is no joint 99" in asker.ask("/hold", 99, 1)[3]
    assert list(show_state(folder).dance) == ["hand lShldr"]


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
    assert declared(folder, "rate") == ("", -1.0)
    asker.tell("/player/stop")
    until(lambda: declared(folder, "rate") == ("", 0.0))
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
    assert asker.ask_all("/hands") == [["/hands/hand", "lShldr", "left-wrist", 0], ["/end", "/hands", 1]]


def test_questions_without_a_stage_have_empty_answers(asker: Asker) -> None:
    for question in ("/cues", "/phrases", "/looks", "/hands"):
        assert asker.ask_all(question) == [["/end", question, 0]]
    status, end = asker.ask_all("/status")
    assert (status[0], status[1], end) == ("/bunraku/status", "absent", ["/end", "/status", 1])


def bundle(address: str, count: int) -> bytes:
    builder = OscBundleBuilder(IMMEDIATELY)
    for _ in range(count):
        builder.add_content(OscMessageBuilder(address).build())
    return bytes(builder.build().dgram)


def test_a_bundle_full_of_questions_is_answered_once(stage: StageDouble, asker: Asker) -> None:
    asker.socket.send(bundle("/sensors/list", 60))
    asker.socket.send(bundle("/looks", 60))
    heard = [asker.hear() for _ in range(1 + 59 + 5 + 59)]
    assert [message[0] for message in heard if message].count("/sensors/end") == 1
    assert [message for message in heard if message and message[0] == "/end"] == [["/end", "/looks", 4]]
    assert asker.ask("/ping") == ["/pong"]


def test_a_bundle_that_is_too_long_is_refused_as_one(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.socket.send(bundle("/player/start", 150))
    heard = asker.hear()
    assert heard is not None
    assert "at most 64 messages" in heard[3]
    assert asker.ask("/ping") == ["/pong"]
    assert show_state(folder).generation == 0


def test_what_a_box_says_is_never_answered_so_that_two_boxes_do_not_talk_for_ever(
    control: ControlInThread, asker: Asker
) -> None:
    answers = [
        *("/reply", "/pong", "/end", "/sensors/reply", "/sensors/sensor", "/sensors/end", "/bunraku/status"),
        *("/cues/cue", "/phrases/phrase", "/looks/look", "/hands/hand"),
    ]
    for address in answers:
        asker.tell(address, "x")
    assert asker.ask("/ping") == ["/pong"]
    assert control.process.handler.refused == len(answers)


def test_a_flood_of_declarations_leaves_the_newest_in_force(
    folder: Path, control: ControlInThread, stage: StageDouble, asker: Asker
) -> None:
    other = Asker(control.port)
    stage.obeys = False
    for number in range(1000):
        asker.tell("/iterations", 1 + number % 50, 1)
        if number % 50 == 49:  # so that the kernel drops none on the way
            assert other.ask("/ping") == ["/pong"]
    stage.obeys = True
    assert other.ask("/iterations", 7, 6)[2] == 1
    other.close()
    assert declared(folder, "iterations") == ("", 7.0, 6.0)
    assert "this one gets no answer" in control.process.handler.reason


def test_a_flood_of_orders_leaves_the_stage_at_four_a_tick(
    control: ControlInThread, stage: StageDouble, asker: Asker
) -> None:
    begun = time.monotonic()
    other = Asker(control.port)
    for number in range(3000):
        asker.tell("/player/jump", number)
        if number % 50 == 49:  # so that the kernel drops none on the way
            assert other.ask("/ping") == ["/pong"]
    assert other.ask("/hold", "lShldr", 0)[:3] == ["/reply", "/hold", 1]
    other.close()
    ticks = (time.monotonic() - begun) / 0.02
    assert len(stage.orders) <= 4 * (ticks + 2)
    assert "Too many commands came at once" in control.process.handler.reason


def test_the_roster_is_told_as_the_stage_saw_it_last(
    stage: StageDouble, asker: Asker, key_file: Path
) -> None:
    line = ["left-wrist", "1a2b3c4d", "linked", "10.0.0.7:2390", 50.0, 0.5, 0.25, -1.0, 87, 51, 1]
    texts = ["1.0.0", "00112233445566778899aabbccddeeff", "taken", ""]
    stage.tell(sensors=[line + texts], looked_at=time.monotonic() - 5.0)
    sensor, end = asker.ask_all("/sensors/list")
    assert sensor == ["/sensors/sensor", *line, *texts]
    assert end[:2] == ["/sensors/end", 1]
    assert 5.0 <= end[2] < 65.0
    assert end[3] == str(key_file)
    stage.tell(looked_at=time.monotonic() + 60.0)  # after show control, held up for a moment, read its clock
    assert asker.ask_all("/sensors/list")[-1][2] == 0.0


def test_the_roster_of_a_box_that_is_starting_and_of_none(folder: Path, key_file: Path, asker: Asker) -> None:
    [reply] = asker.ask_all("/sensors/list")
    assert reply[:3] == ["/sensors/reply", "/sensors/list", 0]
    assert "No stage dances on this box" in reply[3]
    with StageDouble(folder):
        until(lambda: asker.ask_all("/sensors/list") == [["/sensors/end", 0, -1.0, str(key_file)]])


def test_a_reload_brings_the_keys_along(stage: StageDouble, asker: Asker, key_file: Path) -> None:
    assert asker.ask("/sensors/reload") == ["/sensors/reply", "/sensors/reload", 1, "reload it is."]
    [order] = stage.orders
    assert order.keys == load_keys(key_file)
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
    _, about, done, words = asker.ask("/sensors/reload")
    assert (about, done) == ("/sensors/reload", 0)
    assert complaint in words
    assert "goes on with the keys that it has" in words
    assert stage.orders == []


def test_a_box_without_a_key_file_says_so(folder: Path) -> None:
    control = ControlInThread(folder)
    asker = Asker(control.port)
    assert "no key file" in asker.ask("/sensors/reload")[3]
    asker.close()
    control.close()


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


def test_what_was_in_force_stays_in_force_over_a_restart_and_is_said(folder: Path) -> None:
    first = ControlInThread(folder)
    asker = Asker(first.port)
    asker.ask("/panic")
    asker.ask("/master", 0.5)
    asker.close()
    first.close()
    second = ControlInThread(folder)
    assert second.said == ["Still from before: Panic is in force: black, lights safe. /go lifts it."]
    assert show_state(folder).panic
    assert show_state(folder).master == 0.5
    second.close()


def test_names_that_another_show_has_left_are_forgotten(folder: Path) -> None:
    writer = ShowStateWriter(folder)
    left = ShowState(panic=True, cue="storm", look="ink", lights="cold", look_before="lines")
    writer.write(left.with_dance(1.0, {"phrase": ("quiet", (0.0,))}))
    writer.close()
    control = ControlInThread(folder)
    with StageDouble(folder, facts(looks=("ink", "glass"), cues=(), lights=())):
        generation = show_state(folder).generation
        now = ShowState(panic=True, look="ink", show="A test", generation=generation)
        until(lambda: show_state(folder) == now)
    control.close()


def test_two_show_controls_do_not_share_a_folder(folder: Path, control: ControlInThread) -> None:
    with pytest.raises(OSError, match="unavailable"):
        ControlInThread(folder)


def test_a_stage_that_hangs_holds_up_no_answer(
    control: ControlInThread, stage: StageDouble, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many ask a stage that is silent; whoever asks show control itself hears at once."""
    monkeypatch.setattr(order_dispatch, "PATIENCE_S", 0.5)
    stage.obeys = False
    askers = [Asker(control.port) for _ in range(5)]
    waiting = [threading.Thread(target=asker.ask, args=("/cue", "storm"), daemon=True) for asker in askers]
    for one in waiting:
        one.start()
    quick = Asker(control.port)
    assert quick.ask("/panic")[2] == 1
    for one in waiting:
        one.join()
    for one in (quick, *askers):
        one.close()


def test_each_command_is_carried_out_somewhere() -> None:
    tables = (ORDERS, DECLARATIONS, QUESTIONS)
    assert set(FORMS) == {"/ping", "/sensors/list"}.union(*tables)
