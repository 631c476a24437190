"""A live dancer's stream at the port: large, quick, partial, with impossible numbers; and no command."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.fallback import Fallen
from appliance.box.live_pose import LivePoseReader
from appliance.levers.sources import LIVE
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.outputs.shared_frame import FrameWriter
from appliance.show_control.intake import LIVE_WAITING
from appliance.show_control.live_input import POSITIONS, ROTATIONS
from appliance.show_control.port import open_port
from appliance.show_control.run import ControlProcess
from appliance.show_control.settings import ControlSettings
from appliance.show_control.vmc_input import BONE, ROOT
from tests.logged import said
from tests.show_control.doubles import FIGURE, HOST, Asker, Clock, ControlInThread, StageDouble, facts, until
from tests.show_control.fuzz import bundle, message

REST = (0.0, 0.0, 0.0, 1.0)
BONES = tuple(humanoid_bones(FIGURE.names))
SHOW = replace(facts(), phrases=("main", LIVE))


@pytest.fixture
def stage(folder: Path) -> Iterator[StageDouble]:
    with StageDouble(folder, SHOW) as stage:
        yield stage


@pytest.fixture
def process(folder: Path, clock: Clock) -> Iterator[ControlProcess]:
    settings = ControlSettings(str(folder), open_port(HOST, 0).detach())
    with (
        closing(FrameWriter(folder, SHOW)),
        closing(ControlProcess(settings, clock)) as process,
    ):
        yield process


def bone(name: str, *rotation: float) -> bytes:
    return message(BONE, name, 0.0, 0.0, 0.0, *(rotation or REST))


def doubles(address: str, name: str, *numbers: float) -> bytes:
    """The same with arguments of OSC's type d."""
    head = message(address, name)
    tags = f",s{'d' * len(numbers)}".encode()
    tags += bytes(4 - len(tags) % 4)
    return head.replace(b",s\0\0", tags, 1) + struct.pack(f">{len(numbers)}d", *numbers)


def of(process: ControlProcess, name: str, now: float) -> Fallen | None:
    return next((one for _, one in process.observer.fallbacks(now) if one.name == name), None)


def test_a_bundle_of_a_whole_figure_and_its_face_reaches_the_stage(
    folder: Path, stage: StageDouble, control: ControlInThread, asker: Asker
) -> None:
    """SlimeVR sends all bones of the protocol in one datagram of more than 4,096 bytes."""
    asker.ask("/ping")
    others = [f"Finger{number}" for number in range(50 - len(BONES))]
    whole = bundle(
        message("/VMC/Ext/OK", 1),
        message("/VMC/Ext/T", 1.0),
        message(ROOT, "root", 0.0, 0.0, 0.0, *REST),
        *(bone(name) for name in (*BONES, *others)),
        *(message("/VMC/Ext/Blend/Val", f"face{number}", 0.5) for number in range(100)),
    )
    assert 4096 < len(whole) < 65_507
    with closing(LivePoseReader(folder)) as reader:
        for _ in range(3):
            asker.socket.send(whole)
        until(lambda: (heard := reader.read()) is not None and heard.joints == len(FIGURE))
    assert asker.ask("/ping") == ["/pong"]


@pytest.mark.parametrize(
    ("received", "text"),
    [
        (doubles(ROOT, "root", 1e39, 0.0, 0.0, *REST), "farther than 1000 m"),
        (doubles(BONE, "Hips", 0.0, -1e308, 0.0, *REST), "farther than 1000 m"),
        (doubles(BONE, "LeftUpperArm", 0.0, 0.0, 0.0, 0.0, 0.0, 1e300, 1.0), "length 1"),
        (message(POSITIONS, *[3e30] * 3 * len(FIGURE)), "farther than 1000 m"),
        (message(ROTATIONS, *[3e30] * 4 * len(FIGURE)), "length 1"),
    ],
)
def test_numbers_that_no_figure_has_are_refused_told_and_end_nothing(
    folder: Path, stage: StageDouble, control: ControlInThread, asker: Asker, received: bytes, text: str
) -> None:
    """Doubles above 3.4e38 once ended show control."""
    asker.ask("/ping")
    asker.socket.send(received)
    heard = asker.hear()
    assert heard is not None and heard[2] == 0 and text in heard[3]
    reported = [one for one in asker.ask_all("/fallbacks") if one[1] == "live-refused"]
    assert reported and reported[0][4] == 1 and text in reported[0][5]
    with closing(LivePoseReader(folder)) as reader:
        assert reader.read() is None
    assert asker.ask("/panic")[2] == 1


def test_an_error_of_this_program_ends_no_process_and_is_told_at_a_limited_rate(
    process: ControlProcess, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:

    def fails(*_: Any) -> None:
        raise ZeroDivisionError("of a test")

    monkeypatch.setattr(process.handler, "_declare", fails)
    with closing(Asker(process.port.number)) as asker:
        for _ in range(3):
            asker.socket.send(bundle(message("/master", 0.5), message("/ping")))
            process.turn()
            heard = asker.hear()
            assert heard is not None and heard[2] == 0 and "an error of this program" in heard[3]
            assert asker.hear() == ["/pong"]  # the rest of the bundle is carried out
    assert [text for text in said if "ZeroDivisionError: of a test" in text] == said and len(said) == 1
    failed = of(process, "command-failed", clock.now)
    assert failed is not None and (failed.times, failed.active, failed.about) == (3, True, "/master")


def test_what_the_stage_publishes_cannot_end_show_control(
    process: ControlProcess, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process.handler, "follow_stage", lambda now: 1 / 0)
    with closing(Asker(process.port.number)) as asker:
        for _ in range(3):
            asker.tell("/panic")
            process.turn()
            heard = asker.hear()
            assert heard is not None and heard[:3] == ["/reply", "/panic", 1]
    failed = of(process, "command-failed", clock.now)
    assert failed is not None and failed.times == 3


def test_a_stream_is_no_command_waits_by_itself_and_what_gives_way_is_told(
    process: ControlProcess, clock: Clock
) -> None:
    """20 bones 60 times a second were counted as commands that gave way."""
    with closing(Asker(process.port.number)) as program, closing(Asker(process.port.number)) as desk:
        sent = 0
        while sent < LIVE_WAITING + 200:
            for _ in range(100):
                program.socket.send(bone(BONES[sent % len(BONES)]))
                sent += 1
            process._intake.take()  # reads the socket, and carries out nothing
        desk.tell("/ping")
        process.turn()
        assert desk.hear() == ["/pong"]
    assert of(process, "commands-dropped", clock.now) is None
    dropped = of(process, "live-dropped", clock.now)
    assert dropped is not None and dropped.active and dropped.times >= 200


def test_panic_waits_for_a_few_figures_of_a_stream_and_not_for_all(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """50 bones in a bundle take a millisecond: 64 of them held panic up by 270 ms."""
    clock = Clock()
    settings = ControlSettings(str(folder), open_port(HOST, 0).detach())
    with (
        closing(FrameWriter(folder, SHOW)),
        closing(ControlProcess(settings, clock)) as process,
        closing(Asker(process.port.number)) as program,
    ):
        process.turn()
        heard: list[str] = []

        def slow(address: str, *_: Any) -> None:
            heard.append(address)
            clock.now += 0.001

        monkeypatch.setattr(process.handler, "_hear_live", slow)
        for number in range(60):
            program.socket.send(bone(BONES[number % len(BONES)]))
        process.turn()
        assert 1 < len(heard) < 10
        program.tell("/panic")
        process.turn()
        assert (reply := program.hear()) is not None and reply[:3] == ["/reply", "/panic", 1]
        for _ in range(60):
            process.turn()
        assert len(heard) == 60


def test_a_stream_of_any_rate_that_is_read_in_time_loses_nothing(
    process: ControlProcess, clock: Clock
) -> None:
    with closing(Asker(process.port.number)) as program:
        for _ in range(60):
            for name in (*BONES, *(f"Finger{number}" for number in range(20 - len(BONES)))):
                program.socket.send(bone(name))
            process.turn()
    assert of(process, "commands-dropped", clock.now) is None
    assert of(process, "live-dropped", clock.now) is None


def test_how_much_of_a_live_dancer_comes_is_answered_and_told(
    folder: Path, stage: StageDouble, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    assert "No live dancer is heard" in asker.ask("/phrase", LIVE)[3]
    asker.ask("/phrase", "main")

    def stream(*names: str) -> str:
        for _ in range(3):
            for name in names:
                asker.socket.send(bone(name))
        return asker.status().live

    until(lambda: stream("LeftUpperArm") == f"1 of {len(BONES)} bones")
    answer = asker.ask("/phrase", LIVE)[3]
    assert f"1 of {len(BONES)} bones come, without Hips" in answer and "stay with the phrase" in answer
    stream("LeftUpperArm")
    reported = [one for one in asker.ask_all("/fallbacks") if one[1] == "live-partial"]
    assert reported and reported[0][4] == 1 and f"1 of {len(BONES)} bones" in reported[0][5]
    until(lambda: stream(*BONES) == f"{len(BONES)} of {len(BONES)} bones")
    assert [one[4] for one in asker.ask_all("/fallbacks") if one[1] == "live-partial"] == [0]
    with closing(LivePoseReader(folder)) as reader:
        heard = reader.read()
    assert heard is not None
    known = np.isfinite(np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)).all(axis=1)
    assert known[list(humanoid_bones(FIGURE.names).values())].all()
