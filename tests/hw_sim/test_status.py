"""The emulator's line: once a second on a terminal; elsewhere a first word; a last one in any case."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from hw_sim import motions
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator
from hw_sim.status import StatusLine
from hw_sim.wearer import Wearer
from tests.hw_sim.tiny_box import KEY, Pair


def played(answers: bool = True, is_up: bool = True) -> Emulator:
    """A second of readings, after the start-up of the IMU."""
    pair = Pair(EmulatedSensor(KEY, Wearer(motions.still())))
    pair.box.answers, pair.line.is_up = answers, is_up
    pair.run(1.69)
    return pair.emulator


def test_on_a_terminal_one_line_a_second() -> None:
    out = StringIO()
    emulator = played()
    with StatusLine("box:9750", Console(file=out, force_terminal=True, width=120)) as status:
        status.show(emulator, 100.0)
        drawn = len(out.getvalue())
        status.show(emulator, 100.9)
        assert len(out.getvalue()) == drawn
        status.show(emulator, 101.0)
        assert "left-wrist (light on) -> box:9750" in out.getvalue()[drawn:]
        status.end(emulator)
    assert "50 readings sent" in out.getvalue()


def test_elsewhere_the_first_and_the_last_word() -> None:
    out = StringIO()
    emulator = played()
    with StatusLine("box:9750", Console(file=out, width=100)) as status:
        status.show(emulator, 100.0)
        assert out.getvalue() == "Calling the box at box:9750.\n"
        status.end(emulator)
    assert out.getvalue().endswith("box:9750.\n1 sensor -> box:9750: 50 readings sent\n")


def test_when_nothing_got_out_it_says_what_to_look_at() -> None:
    out = StringIO()
    with StatusLine("/dev/ttyUSB0", Console(file=out, width=100)) as status:
        status.end(played(is_up=False))
    assert "Nothing could be sent to /dev/ttyUSB0" in out.getvalue()


def test_when_no_box_took_the_sensors_it_says_what_to_look_at() -> None:
    out = StringIO()
    with StatusLine("box:9750", Console(file=out, width=100)) as status:
        status.end(played(answers=False))
    assert "No box took these sensors at box:9750" in out.getvalue()
    assert "the same key file" in out.getvalue()
