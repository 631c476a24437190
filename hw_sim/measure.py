"""`bunraku measure`: proves before the doors open how fast the box answers and how evenly it ticks."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
import yaml

from appliance.sensor.keys import create_keys
from hw_sim.latency import Floats, Transport, missing_frames, percentiles, response_ms, steps, transport
from hw_sim.probe import Course, ProbeError, Run, Setting, run

REFUSED, FAILED = 2, 1
SETTLING_S = 3.0  # the first seconds do not count: the phase lock moves at most 10 ms in a second
BEAT_S = 0.02
FREE_SETTLING_S = 1.0
LOCKED_DRIFT_PPM = 60.0  # what a wearable's crystal may be off by; the lock has to follow it
LATE = 1  # flag of the journal

NAMED = {"p50": 50.0, "p99": 99.0, "p999": 99.9, "max": 100.0}


class Limit(NamedTuple):
    """One figure of the verdict."""

    words: str
    value: float | None
    most: float
    unit: str

    @property
    def holds(self) -> bool:
        return self.value is not None and self.value <= self.most


def measure(
    seconds: Annotated[
        float, typer.Option(min=4.0, help="Length of the phase-locked run; 120 for 6,000 ticks.")
    ] = 30.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures here.")] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write measure.png and measure.json into this folder.")
    ] = None,
    show: Annotated[
        Path | None, typer.Option(help="Show bundle; left out: the one that comes with the box.")
    ] = None,
    box: Annotated[
        Path | None, typer.Option(help="box.yaml of the venue: its limits and real-time settings.")
    ] = None,
) -> None:
    """Measure the whole way, datagram in to datagram out, with an emulated sensor on a venue's network.

    Two runs: the tick in phase with the sensor, then running free while the sensor's clock drifts through one
    whole beat, so that every offset between the two counts alike. Exit status 0 when all limits hold, else 1.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="bunraku-measure-") as scratch:
            setting = _setting(show, box, Path(scratch))
            print(f"Measuring {seconds:g} s in phase with the sensor ...", flush=True)
            locked = run(setting, locked_course(seconds))
            free_s = max(6.0, seconds / 3.0)
            print(f"Measuring {free_s:g} s running free ...", flush=True)
            free = run(setting, free_course(free_s))
    except (ProbeError, OSError, ValueError) as error:
        print(f"bunraku measure: {error}", file=sys.stderr)
        raise typer.Exit(REFUSED) from None
    figures = figures_of(locked, free)
    limits = verdict(figures)
    for line in table(figures, limits):
        print(line)
    written = [json_file] if json_file is not None else []
    if report is not None:
        from hw_sim.report import draw_report

        report.mkdir(parents=True, exist_ok=True)
        written.append(report / "measure.json")
        print(f"Picture: {draw_report(report / 'measure.png', locked, ways_of(locked, free))}")
    for path in written:
        path.write_text(json.dumps(figures, indent=2) + "\n")
    raise typer.Exit(0 if all(limit.holds for limit in limits) else FAILED)


def locked_course(seconds: float) -> Course:
    """In phase; the last part with the phrase standing still, for the response to steps."""
    return Course("locked", seconds, min(12.0, seconds / 3.0), True, LOCKED_DRIFT_PPM, seed=1)


def free_course(seconds: float) -> Course:
    """Running free; the sensor's clock loses one beat of 20 ms in the time that counts."""
    return Course("free", seconds, 0.0, False, -1e6 * BEAT_S / (seconds - FREE_SETTLING_S), seed=2)


def transport_of(one: Run, settling_s: float) -> Transport:
    """The way of the readings that count: those sent after the first seconds."""
    begin = min((reading.sent_at for reading in one.readings), default=0.0) + settling_s
    return transport([reading for reading in one.readings if reading.sent_at >= begin], one.frames)


def ways_of(locked: Run, free: Run) -> tuple[Transport, Transport]:
    """The transport of both runs."""
    return transport_of(locked, locked_settling_s(locked)), transport_of(free, FREE_SETTLING_S)


def figures_of(locked: Run, free: Run) -> dict[str, Any]:
    """All figures; milliseconds, seconds and megabytes as their names say, None where nothing came."""
    way, free_way = ways_of(locked, free)
    standing = [moment for moment in steps(locked.readings) if moment >= locked.stood_from + 0.5]
    response = response_ms(standing, locked.frames)
    costs_ms: Floats = locked.ticks["sections_ms"].sum(axis=1).astype(np.float64)
    return {
        "transport_ms": percentiles(way.latency_ms, NAMED),
        "free_running_transport_ms": percentiles(free_way.latency_ms, {"p50": 50.0, "p99": 99.0}),
        "response_ms": percentiles(response, {"p50": 50.0}),
        "ticks": len(locked.ticks),
        "late_ticks": int(((locked.ticks["flags"] & LATE) > 0).sum()),
        "missing_frames": missing_frames(locked.frames),
        "tick_ms": percentiles(costs_ms, {"p50": 50.0, "p99": 99.0, "max": 100.0}),
        "sections_ms": {
            name: percentiles(locked.ticks["sections_ms"][:, place], {"p50": 50.0, "p99": 99.0})
            for place, name in enumerate(locked.sections)
        },
        "rss_mb": round(locked.rss_mb, 1),
        "start_to_first_frame_s": round(locked.start_to_first_frame_s, 3),
        "readings": len(way.latency_ms),
        "overtaken_readings": way.overtaken,
        "steps": len(response),
    }


def locked_settling_s(locked: Run) -> float:
    """Three seconds, or half of a run that is shorter than six."""
    times = [reading.sent_at for reading in locked.readings]
    return min(SETTLING_S, (max(times) - min(times)) / 2.0) if times else SETTLING_S


def verdict(figures: dict[str, Any]) -> list[Limit]:
    """The figures that have limits."""
    free_p50 = figures["free_running_transport_ms"]["p50"]
    late_share = 100.0 * figures["late_ticks"] / max(1, figures["ticks"])
    return [
        Limit("transport, median", figures["transport_ms"]["p50"], 3.0, "ms"),
        Limit(
            "transport, median, against free running / 4",
            figures["transport_ms"]["p50"],
            (free_p50 or 0.0) / 4,
            "ms",
        ),
        Limit("tick, median", figures["tick_ms"]["p50"], 2.0, "ms"),
        Limit("tick, p99", figures["tick_ms"]["p99"], 6.0, "ms"),
        Limit("late ticks", late_share, 0.1, "%"),
        Limit("missing frames", 100.0 * figures["missing_frames"] / max(1, figures["ticks"]), 0.1, "%"),
        Limit("memory of the box", figures["rss_mb"], 120.0, "MB"),
        Limit("start to first frame", figures["start_to_first_frame_s"], 1.5, "s"),
    ]


def table(figures: dict[str, Any], limits: Sequence[Limit]) -> list[str]:
    """What a technician reads."""
    way, free, response = (
        figures["transport_ms"],
        figures["free_running_transport_ms"],
        figures["response_ms"],
    )
    lines = [
        "transport  " + "  ".join(f"{name} {_ms(value)}" for name, value in way.items()),
        f"  ({figures['readings']} readings, {figures['overtaken_readings']} of them overtaken by newer)",
        f"  running free  p50 {_ms(free['p50'])}  p99 {_ms(free['p99'])}",
        f"response to a step, half of the way  p50 {_ms(response['p50'])}   ({figures['steps']} steps)",
        "tick by section, p50  "
        + "  ".join(f"{name} {_ms(part['p50'])}" for name, part in figures["sections_ms"].items()),
        "",
    ]
    for limit in limits:
        value = "nothing came" if limit.value is None else f"{limit.value:.2f} {limit.unit}"
        mark = "ok  " if limit.holds else "FAIL"
        lines.append(f"{mark}  {limit.words}: {value} (at most {limit.most:.2f} {limit.unit})")
    return lines


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} ms"


def _setting(show: Path | None, box: Path | None, scratch: Path) -> Setting:
    """Reads of show and box file only what the measurement needs; the box itself checks the rest."""
    show = show or _default_show()
    config = _plain_yaml(show / "show.yaml")
    hands = [hand for hand in config.get("hands") or [] if isinstance(hand, dict) and hand.get("sensor")]
    if not hands:
        raise ProbeError(f"{show}: no sensor holds a joint in this show, so there is no way to follow.")
    followed = next((hand for hand in hands if hand.get("primary")), hands[0])
    keys = scratch / "sensors.keys"
    create_keys(keys, list(dict.fromkeys(hand["sensor"] for hand in hands)))
    return Setting(
        show=show.resolve(),
        box=_plain_yaml(box) if box is not None else {},
        keys=keys,
        sensor=followed["sensor"],
        joint=followed["joint"],
        scratch=scratch,
    )


def _plain_yaml(path: Path) -> dict[str, Any]:
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    except OSError as error:
        raise ProbeError(f"{path}: cannot be read ({error.strerror}). Check its name and place.") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ProbeError(f"{path}: is not YAML. `bunraku check` says where.") from error
    if not isinstance(values, dict):
        raise ProbeError(f"{path}: does not consist of keys. `bunraku check` says more.")
    return values


def _default_show() -> Path:
    """The bundle inside the box's package; found without importing any of it."""
    package = find_spec("appliance")
    if package is None or not package.submodule_search_locations:
        raise ProbeError("The box's package `appliance` is not installed.")
    return Path(package.submodule_search_locations[0]) / "show" / "default_show"
