"""The clock is wrong: a box without a battery wakes up in 1970, and is put right by a year in mid-show."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.boot import rights
from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import lives, longest_pause_s, missing_ticks

# The kernel has one clock for all containers: what the box's processes are told of it is changed on the way.
_DROP_IN = """[Service]
Environment=LD_PRELOAD=/wrong-clock/libfaketime.so.1
Environment=FAKETIME_TIMESTAMP_FILE=/wrong-clock/now FAKETIME_NO_CACHE=1
Environment=FAKETIME_DONT_FAKE_MONOTONIC=1 DONT_FAKE_MONOTONIC=1 FAKETIME_DISABLE_SHM=1
"""

pytestmark = pytest.mark.boot


def test_1970_and_then_a_jump_of_a_year_in_mid_show(box: Box, tmp_path: Path, figures: Figures) -> None:
    library = rights.faketime()
    if library is None:
        pytest.skip("libfaketime (Debian package of this name) is missing")
    clock, drop_in = tmp_path / "clock", tmp_path / "clock.conf"
    clock.mkdir()
    (clock / library.name).write_bytes(library.read_bytes())
    set_clock(clock / "now", years=1970 - time.gmtime().tm_year)
    drop_in.write_text(_DROP_IN)
    for path in (clock, *clock.iterdir(), drop_in):
        path.chmod(0o755 if path.is_dir() else 0o644)
    shared = "/etc/systemd/system/bunraku-.service.d/90-clock.conf"
    box.power_on(binds=((box.boot, "/boot/bunraku"), (clock, "/wrong-clock"), (drop_in, shared)))
    first = box.await_frames()[0]
    figures.note("power-on in 1970 to first frame", first.at - box.machine.powered_at)
    assert "libfaketime" in Path(f"/proc/{box.machine.main_pid(STAGE)}/maps").read_text()
    assert _year_in_the_box(box) < 1972
    box.hall.dance_with_sensor()
    box.await_sensor()
    jumped = time.time()
    set_clock(clock / "now", years=1971 - time.gmtime().tm_year)
    box.hall.audience.watch(1.5)
    set_clock(clock / "now", years=0)
    seen = [frame for frame in box.hall.audience.watch(1.5) if frame.at > jumped]
    assert _year_in_the_box(box) > 2025
    assert lives(seen) == 1 and longest_pause_s(seen) < 0.5 and seen[-1].sequence >= 0
    figures.note("ticks missing while the clock jumps by a year", missing_ticks(seen), limit=0, unit="ticks")
    left, killed = box.place(), box.machine.kill(STAGE)
    _, after = box.pause_from(killed)
    figures.note("SIGKILL to next frame after the clock jumped", after.at - killed, limit=1.0)
    assert box.place().phrase == left.phrase
    assert box.place().position_s == pytest.approx(left.position_s, abs=10.0)
    box.await_sensor()
    box.hall.switch_sensor_off()


def set_clock(path: Path, years: int) -> None:
    """How far off the box's clock is from now on."""
    path.write_text(f"{years * 365 * 86400:+d}\n")


def _year_in_the_box(box: Box) -> int:
    """As a process with the units' environment is told."""
    words = [line.removeprefix("Environment=").split() for line in _DROP_IN.splitlines()[1:]]
    return int(box.machine.run("env", *(word for some in words for word in some), "date", "+%Y"))
