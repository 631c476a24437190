"""Many hours of dance as fast as the processor can: `python -m tests.stage.long_evening --hours 24`.

The stage's own loop, with journal and checkpoints in memory, on a clock that does not wait. Sensors send by
UDP over an emulated venue's network, and fall silent now and then; cues, stops and levers come as from a
desk. No tick is late here: what the machine does to the dance is seen by `make soak`.
"""

from __future__ import annotations

from tests.stage.fast_clock import CLOCK

# isort: split
import argparse
import os
import random
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.outputs.shared_frame import Facts
from appliance.pose import quaternion
from appliance.sensor.keys import create_keys
from appliance.show.box import load_box
from appliance.show.bundle import default_show_path
from appliance.show.show import Show, load_show
from appliance.show_control.command import Command
from appliance.show_control.show_state_commands import declare
from appliance.stage.run import Stage
from appliance.stage.sharing import facts_of
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator
from hw_sim.motions import dance
from hw_sim.network import VENUE, VenueNetwork
from hw_sim.peers import HOST, free_ports
from hw_sim.senders import UdpSender
from hw_sim.soak.vitals import vitals
from hw_sim.wearer import Wearer

ROW_S = 600.0
MOST_GROWTH_MB = 2.0  # after the first row
STANDS_S = 5.0  # after /stop and /panic
ANYTIME = (
    *(("/player/rate", (rate,)) for rate in (1.0, 1.3, -1.0)),
    *(("/liveliness", (share,)) for share in (0.0, 0.5)),
    *(("/springs/storm", (strength,)) for strength in (0.0, 0.6)),
    ("/stop", ()),
    ("/panic", ()),
)


class Evening:
    """A stage, its sensors and a desk; `faults`: what was wrong, and how often."""

    def __init__(self, show: Show, folder: Path, seed: int) -> None:
        (port,) = free_ports(1)
        names = sorted({hand.sensor for one in show.config.cast for hand in one.hands if hand.sensor})
        keys = create_keys(folder / "sensors.keys", names)
        box_file = folder / "box.yaml"
        box_file.write_text(yaml.safe_dump(_settings(folder, port)))
        self.stage = Stage(show, load_box(box_file), box_file)
        self.stage.lead_s = 0.0  # nothing cools down where nothing waits
        self.begun = CLOCK.now
        self.faults: Counter[str] = Counter()
        self.ticks, self.farthest_m, self.turned = 0, 0.0, np.zeros(181, np.int64)
        self._facts: Facts = facts_of(show, box_file, self.stage.iterations, self.begun, False)
        self._state, self._writer = ShowState(show=show.config.name), ShowStateWriter(folder / "runtime")
        self._random = random.Random(seed)
        self._cues = [("/cue", (), cue["name"]) for cue in self._facts.cues]
        self._devices = [EmulatedSensor(keys[name], Wearer(dance(seed), 3.0)) for name in names]
        senders = [{Lane.NETWORK: UdpSender(HOST, port)} for _ in names]
        network = VenueNetwork(VENUE, seed)
        self._sensors = Emulator(self._devices, senders, network=network, clock=CLOCK.monotonic)
        self._sensors.start(self.begun)
        self._sensors_due, self._act_at, self._go_at = 0.0, self.begun + 20.0, float("inf")
        self._before: list[np.ndarray] = []
        self._row_at, self._row_cpu = self.begun + ROW_S, time.process_time()
        self._first: tuple[float, int] | None = None

    def dance(self, seconds: float) -> None:
        CLOCK.meanwhile = self._pass
        self.stage.dance(seconds, lambda: False)
        self.stage.close()
        self._sensors.close()
        self._writer.close()
        if self.stage.recorder is None or self.stage.recorder.lost:
            self.faults["what the journal lost"] += 1
        if self.stage.health.skipped:
            self.faults["missing ticks"] += self.stage.health.skipped

    def _pass(self, until: float) -> None:
        """Until the next tick: what sensors and desk do, and a look at the frame that has left."""
        while max(self._sensors_due, CLOCK.now) <= until:
            CLOCK.now = max(CLOCK.now, self._sensors_due)
            self._sensors_due = max(self._sensors.step(CLOCK.now), CLOCK.now + 1e-4)
        self._look()
        if until >= self._go_at:
            self._go_at = float("inf")
            self._command("/go", (), "", until)
        elif until >= self._act_at:
            self._act_at = until + self._random.uniform(10.0, 60.0)
            self._act(until)
        if until >= self._row_at:
            self._row_at += ROW_S
            self._row(until)

    def _act(self, now: float) -> None:
        if self._devices and self._random.random() < 0.3:
            self._random.choice(self._devices).switch_off(now, self._random.uniform(0.2, 30.0))
            return
        address, values, *cue = self._random.choice([*self._cues, *ANYTIME])
        self._command(address, values, "".join(cue), now)
        if address in ("/stop", "/panic"):
            self._go_at = now + STANDS_S

    def _command(self, address: str, values: tuple[float, ...], text: str, now: float) -> None:
        try:
            self._state, _ = declare(self._state, Command(address, values, text), self._facts, now)
        except ValueError:  # this show has no springs
            return
        self._writer.write(self._state)

    def _look(self) -> None:
        self.ticks += 1
        poses = [np.array(one.pose, np.float64) for one in self.stage.tick.frame.puppets]
        roots = np.array([one.root for one in self.stage.tick.frame.puppets])
        if not (np.isfinite(roots).all() and all(np.isfinite(pose).all() for pose in poses)):
            self.faults["numbers that are none"] += 1
            return
        self.farthest_m = max(self.farthest_m, float(np.abs(roots[:, [0, 2]]).max()))
        for before, pose in zip(self._before, poses, strict=False):
            turned = float(np.degrees(quaternion.angle_between(before, pose).max()))
            self.turned[int(turned)] += 1
        self._before = poses

    def _row(self, now: float) -> None:
        found = vitals(os.getpid())
        assert found is not None
        cpu, ticks = time.process_time(), round(ROW_S * 50)
        print(
            f"{(now - self.begun) / 3600:6.2f} h  {found.anonymous_mb:6.1f} MB  {found.handles} handles  "
            f"{1000 * (cpu - self._row_cpu) / ticks:.2f} ms a tick",
            flush=True,
        )
        self._row_cpu = cpu
        if self._first is None:
            self._first = found.anonymous_mb, found.handles
        elif found.anonymous_mb > self._first[0] + MOST_GROWTH_MB or found.handles > self._first[1]:
            self.faults["rows with more memory or handles than the first"] += 1


def _settings(folder: Path, port: int) -> dict[str, object]:
    (folder / "runtime").mkdir(mode=0o700)
    (folder / "state").mkdir()
    return {
        "sensors": {"udp": {"host": HOST, "port": port}, "keys": str(folder / "sensors.keys")},
        "outputs": {"osc": []},
        "runtime": str(folder / "runtime"),
        "state": str(folder / "state"),
        "realtime": {"enabled": False},
        "limits": {"wait_ms": 0},  # for a late reading: this clock stands still meanwhile
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--show", type=Path, default=default_show_path())
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        evening = Evening(load_show(given.show), Path(folder), given.seed)
        evening.dance(3600.0 * given.hours)
    shares = np.cumsum(evening.turned) / max(evening.turned.sum(), 1)
    turned = [int(np.searchsorted(shares, share)) + 1 for share in (0.5, 0.99, 0.999, 1.0)]
    print(
        f"{evening.ticks} ticks. The joint that turned furthest in a tick, median / 99 / 99.9 / 100 %: "
        f"{' / '.join(map(str, turned))} degrees. Farthest from the middle: {evening.farthest_m:.1f} m."
    )
    for what, count in evening.faults.items():
        print(f"FAULT: {what}: {count}")
    return 1 if evening.faults else 0


if __name__ == "__main__":
    sys.exit(main())
