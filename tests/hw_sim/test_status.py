"""The emulator's line: once a second on a terminal, never elsewhere, and a last word in any case."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from hw_sim import motions
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator
from hw_sim.status import StatusLine
from tests.sensor.test_link import KEYS


def one_second(sends: bool = True) -> Emulator:
    emulator = Emulator(
        [EmulatedSensor(KEYS["head"], motions.still())], lambda data: sends, clock=lambda: 0.0
    )
    emulator.start(0.0)
    for tick in range(50):
        emulator.step(tick * 0.02)
    return emulator


def test_on_a_terminal_one_line_a_second() -> None:
    out = StringIO()
    emulator = one_second()
    with StatusLine("box:9750", Console(file=out, force_terminal=True, width=100)) as status:
        status.show(emulator, 100.0)
        drawn = len(out.getvalue())
        status.show(emulator, 100.9)
        assert len(out.getvalue()) == drawn
        status.show(emulator, 101.0)
        assert "head -> box:9750" in out.getvalue()[drawn:]
        status.end(emulator)
    assert "50 sent" in out.getvalue()


def test_elsewhere_only_the_last_word() -> None:
    out = StringIO()
    emulator = one_second()
    with StatusLine("box:9750", Console(file=out, width=100)) as status:
        status.show(emulator, 100.0)
        assert out.getvalue() == ""
        status.end(emulator)
    assert out.getvalue() == "1 sensor(s) -> box:9750: 50 sent\n"


def test_when_nothing_got_out_it_says_what_to_look_at() -> None:
    out = StringIO()
    with StatusLine("/dev/ttyUSB0", Console(file=out, width=100)) as status:
        status.end(one_second(sends=False))
    assert "Nothing could be sent to /dev/ttyUSB0" in out.getvalue()
