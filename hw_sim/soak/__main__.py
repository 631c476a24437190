"""`python -m hw_sim.soak --minutes 60`: soak the whole box, report each second, and judge it."""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from hw_sim.bundled_shows import show_folder
from hw_sim.peers import ProbeError
from hw_sim.soak.figures import figures_of, limits_of, table
from hw_sim.soak.run import Soak, soak
from hw_sim.soak.vitals import Vitals

REFUSED, FAILED = 2, 1
WRITE_EACH_S = 60.0
LINE_EACH_S = 30.0  # without a terminal


def main(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long it dances.")] = 60.0,
    out: Annotated[Path, typer.Option(help="Folder for soak.json, soak.csv, soak.png.")] = Path("out/soak"),
    show: Annotated[
        Path | None, typer.Option(help="Show bundle. Default: the one that comes with the box.")
    ] = None,
    load: Annotated[bool, typer.Option(help="Load the machine with stress-ng, a minute each.")] = True,
    seed: Annotated[int, typer.Option(help="The same seed gives the same evening.")] = 1,
) -> None:
    """Soak the box: its processes as its units start them, under load, with trouble all the time.

    Sensors fall silent and come back, their network gets bad, receivers
    come and go, a desk sends commands and nonsense, processes beside the
    stage are killed. Frames are counted outside. cyclictest runs at the same
    time with the stage's priority and period: its figures are the machine's
    part. Ctrl-C or SIGTERM ends it early, with figures and a verdict until
    then. Exit status: 0 everything holds, 1 something does not, 2 it could
    not begin.
    """
    stops: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: stops.append(number))
    progress = _Progress(out)
    out.mkdir(parents=True, exist_ok=True)
    try:
        seen = soak(
            *(show_folder(show).resolve(), (out / "box").resolve(), 60.0 * minutes, seed, load),
            lambda: bool(stops),
            progress.each_second,
        )
    except (ProbeError, OSError, ValueError) as error:
        print(f"soak: {error}", file=sys.stderr)
        raise typer.Exit(REFUSED) from None
    progress.end_line()
    for line in table(seen):
        print(line)
    write(out, seen, is_over=True)
    print(f"Written: {out}/soak.json, soak.csv, {_picture(out, seen)}; output of the box: {out}/box/output")
    raise typer.Exit(0 if all(limit.holds for limit in limits_of(seen)) else FAILED)


def write(out: Path, seen: Soak, is_over: bool) -> None:
    """Figures as JSON, and each second as a line of CSV."""
    limits = [limit._asdict() for limit in limits_of(seen)]
    figures: dict[str, Any] = {"is_over": is_over, **figures_of(seen), "limits": limits}
    (out / "soak.json").write_text(json.dumps(figures, indent=2) + "\n")
    names = [unit.name for unit in seen.box.units]
    held = [f"{name}_{what}" for name in names for what in ("rss_mb", "own_mb", "handles", "threads")]
    with (out / "soak.csv").open("w") as file:
        file.write(
            ",".join(["second", "load", "frame_ms", "cyclictest_ms", "spoilt", "celsius", *held]) + "\n"
        )
        for look in seen.looks:
            second = int(look.at)
            cells: list[object] = [
                *(second, look.load),
                *(f"{one.seconds.worst_ms.get(second, 0.0):.2f}" for one in (seen.frames, seen.wakeups)),
                *(seen.frames.seconds.bad[second], look.temperature_c or ""),
            ]
            for name in names:
                one = look.held.get(name)
                cells += [""] * 4 if one is None else _cells(one)
            file.write(",".join(map(str, cells)) + "\n")


def _cells(one: Vitals) -> list[object]:
    return [f"{one.rss_mb:.2f}", f"{one.anonymous_mb:.2f}", one.handles, one.threads]


class _Progress:
    """One line that changes on a terminal, one every half a minute elsewhere; the files every minute."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._is_terminal = sys.stdout.isatty()
        self._line_at = self._write_at = time.monotonic()

    def each_second(self, seen: Soak) -> None:
        now = time.monotonic()
        if self._is_terminal:
            print(f"\r{_line(seen)}\x1b[K", end="", flush=True)
        elif now >= self._line_at:
            self._line_at = now + LINE_EACH_S
            print(_line(seen), flush=True)
        if now >= self._write_at:
            self._write_at = now + WRITE_EACH_S
            write(self._out, seen, is_over=False)

    def end_line(self) -> None:
        if self._is_terminal:
            print()


def _line(seen: Soak) -> str:
    frames, wakeups = seen.frames, seen.wakeups
    held = seen.looks[-1].held.get("stage") if seen.looks else None
    of_machine = (
        wakeups.complaint or f"{wakeups.later_than(15.0)} late, worst {wakeups.delays.worst_ms:.0f} ms"
    )
    return (
        f"{_clock(seen.seconds)}/{_clock(seen.planned_s)}  ticks {frames.heard}  late {frames.late}  "
        f"missing {frames.missing}  worst {frames.delays.worst_ms:.0f} ms  cyclictest: {of_machine}  "
        f"stage {held.rss_mb if held else 0.0:.1f} MB {held.handles if held else 0} handles  "
        f"load {seen.load}  network {seen.network}"
    )


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes:02}:{rest:02}"


def _picture(out: Path, seen: Soak) -> str:
    try:
        from hw_sim.soak.picture import draw_soak

        return draw_soak(out / "soak.png", seen).name
    except ImportError:
        return "no picture (matplotlib is not there)"


if __name__ == "__main__":
    typer.run(main)
