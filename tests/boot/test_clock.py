"""The clock is wrong: a box without a battery wakes up in 1970, and is put right by a year in mid-show."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.boot import wrong_clock
from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import lives, missing_ticks, share
from tests.boot.wrong_clock import ENVIRONMENT, WrongClock

pytestmark = pytest.mark.boot


def test_1970_and_then_a_jump_of_a_year_in_mid_show(box: Box, tmp_path: Path, figures: Figures) -> None:
    why_not = wrong_clock.why_not()
    if why_not is not None:
        pytest.skip(why_not)
    to_1970 = 1970 - time.gmtime().tm_year
    clock = WrongClock(tmp_path, to_1970)
    box.power_on(binds=((box.boot, "/boot/bunraku"), *clock.binds))
    first = box.await_frames()[0]
    figures.note("power-on in 1970 to first frame", first.at - box.machine.powered_at)
    assert ENVIRONMENT["LD_PRELOAD"] in Path(f"/proc/{box.machine.main_pid(STAGE)}/maps").read_text()
    assert _year_in_the_box(box) < 1972
    box.hall.dance_with_sensor()
    box.await_sensor()
    jumped = time.time()
    clock.set(to_1970 + 1)
    box.hall.audience.watch(1.5)
    clock.set(0)
    box.hall.audience.watch(1.5)
    ended = time.time()
    seen = [frame for frame in box.hall.audience.frames if frame.at > jumped]
    assert _year_in_the_box(box) > 2025
    assert lives(seen) == 1 and share(seen, jumped, ended) > 0.1 and seen[-1].sequence >= 0
    figures.note("ticks missing while the clock jumps by a year", missing_ticks(seen), limit=0, unit="ticks")
    left, killed = box.place(), box.machine.kill(STAGE)
    _, after = box.pause_from(killed)
    figures.note("SIGKILL to next frame after the clock jumped", after.at - killed, limit=1.0)
    assert box.place().puppets[0].phrase == left.puppets[0].phrase
    assert box.place().puppets[0].position_s == pytest.approx(left.puppets[0].position_s, abs=10.0)
    box.await_sensor()
    box.hall.switch_sensor_off()


def _year_in_the_box(box: Box) -> int:
    """As a process with the units' environment is told."""
    words = (f"{name}={value}" for name, value in ENVIRONMENT.items())
    return int(box.machine.run("env", *words, "date", "+%Y"))
