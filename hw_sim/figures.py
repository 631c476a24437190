"""The figures of a measurement, their limits, and the table that a technician reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hw_sim.latency import (
    Floats,
    Restart,
    SentReading,
    Transport,
    lag_ms,
    missing_frames,
    percentiles,
    power_on_s,
    response_ms,
    sounded_ms,
    steps,
    transport,
    watched_steps,
)
from hw_sim.probe import Run

SETTLING_S = 3.0  # the first seconds do not count: the phase lock moves at most 10 ms in a second
FREE_SETTLING_S = 1.0
LATE = 1  # flag of the journal
POWER_ON_S, POWER_ON_AND_JOIN_S = 1.0, 5.0  # until a reading is used: network up; Wi-Fi joined first
RESTART_S = 1.5
TRANSPORT_MS = {"transport, median": ("p50", 3.0), "transport, p99": ("p99", 12.0)}
RESPONSE_MS = 45.0  # from a step of the sensor to half of it in the output joint
DANCE_TO_LIGHT_MS = 60.0  # how late the wall follows a hand that dances
SOUND_MS = 15.0  # from a step of the hand to the first audible change that the card's clock plays
STILL_S = 0.3  # after a step, when the hand is still: what changes then is not the hand's
LIGHT_MS = 75.0  # from a step of the hand to half of it on the screen, at 60 pictures a second
NAMED = {"p50": 50.0, "p99": 99.0, "p999": 99.9, "max": 100.0}
FEW = {"p50": 50.0, "max": 100.0}


@dataclass(frozen=True)
class Evidence:
    """Everything that was measured: in phase, running free, with a sensor that is switched off and on, and
    with a box that is killed and restarted."""

    locked: Run
    free: Run
    power_ons: Run
    restarts: Sequence[Restart]
    switched_on: int = 0  # how often the sensor was switched on, and off again before the run ended
    firmware: bool = False  # the compiled firmware was the sensor, and joined a simulated Wi-Fi each time
    light: Run | None = None  # with a projector on a screen that was watched
    light_dance: Run | None = None  # the same with a hand that dances
    sound: Run | None = None  # with the strings on an emulated card

    @property
    def transports(self) -> tuple[Transport, Transport]:
        """The transport of the phase-locked and of the free run."""
        return _transport(self.locked, _settling_s(self.locked)), _transport(self.free, FREE_SETTLING_S)

    @property
    def power_on_s(self) -> Floats:
        return power_on_s(self.power_ons.readings, self.power_ons.frames)

    @property
    def restart_s(self) -> Floats:
        """From the start of the new box to its first frame with a reading."""
        return np.array([one.used_at - one.started_at for one in self.restarts])

    @property
    def kill_s(self) -> Floats:
        """The same from the end of the old box."""
        return np.array([one.used_at - one.killed_at for one in self.restarts])


class Limit(NamedTuple):
    """One figure of the verdict."""

    label: str
    value: float | None
    most: float
    unit: str

    @property
    def holds(self) -> bool:
        return self.value is not None and self.value <= self.most


def _light(run: Run | None, dance: Run | None) -> dict[str, Any]:
    """Figures that the projector's runs add: hand to light, pictures a second; nothing without them."""
    if run is None or dance is None:
        return {}
    standing = [moment for moment in steps(run.readings) if moment >= run.stood_from + 0.5]
    seen = [one.arrived_at for one in run.pictures]
    rate = (len(seen) - 1) / (seen[-1] - seen[0]) if len(seen) > 1 else 0.0
    found = response_ms(standing, run.pictures)
    return {
        "hand_to_light_ms": percentiles(found, FEW, watched_steps(standing, run.pictures) - len(found)),
        "dance_to_light_ms": lag_ms(_danced(dance), dance.pictures),
        "pictures_a_second": round(rate, 1),
        "light_steps": len(found),
    }


def _sound(run: Run | None) -> dict[str, Any]:
    """Hand to sound; nothing without its run. A sound that changes as often while the hand is still has no
    figure: it does not follow."""
    if run is None or run.played is None:
        return {}
    standing = [moment for moment in steps(run.readings) if moment >= run.stood_from + 0.5]
    found = sounded_ms(standing, run.played)
    by_itself = len(sounded_ms([moment + STILL_S for moment in standing], run.played))
    return {
        "hand_to_sound_ms": percentiles(found if len(found) > 2 * by_itself else found[:0], FEW),
        "sound_steps": len(found),
        "sound_changes_without_hand": by_itself,
        "late_sound_blocks": run.played.late,
    }


def _danced(run: Run) -> list[SentReading]:
    """The readings while the phrase stood still."""
    return [reading for reading in run.readings if reading.sampled_at >= run.stood_from + 0.5]


def figures_of(evidence: Evidence) -> dict[str, Any]:
    """All figures; milliseconds, seconds and megabytes as their names say, None where nothing came."""
    locked, (way, free_way) = evidence.locked, evidence.transports
    standing = [moment for moment in steps(locked.readings) if moment >= locked.stood_from + 0.5]
    response = response_ms(standing, locked.frames)
    unseen = watched_steps(standing, locked.frames) - len(response)
    unanswered = max(0, evidence.switched_on - len(evidence.power_on_s))
    costs_ms: Floats = locked.ticks["sections_ms"].sum(axis=1).astype(np.float64)
    return {
        "transport_ms": percentiles(way.latency_ms, NAMED),
        "free_running_transport_ms": percentiles(free_way.latency_ms, {"p50": 50.0, "p99": 99.0}),
        "response_ms": percentiles(response, {"p50": 50.0}, unseen),
        "ticks": len(locked.ticks),
        "late_ticks": int(((locked.ticks["flags"] & LATE) > 0).sum()) + locked.gaps,
        "missing_frames": missing_frames(locked.frames),
        "tick_ms": percentiles(costs_ms, {"p50": 50.0, "p99": 99.0, "max": 100.0}),
        "sections_ms": {
            name: percentiles(locked.ticks["sections_ms"][:, place], {"p50": 50.0, "p99": 99.0})
            for place, name in enumerate(locked.sections)
        },
        "rss_mb": round(locked.rss_mb, 1),
        "start_to_first_frame_s": round(locked.start_to_first_frame_s, 3),
        "power_on_to_reading_s": percentiles(evidence.power_on_s, FEW, unanswered),
        "restart_to_reading_s": percentiles(evidence.restart_s, FEW),
        "kill_to_reading_s": percentiles(evidence.kill_s, FEW),
        "firmware": evidence.firmware,
        "power_ons": len(evidence.power_on_s),
        "unanswered_power_ons": unanswered,
        "restarts": len(evidence.restarts),
        "readings": len(way.latency_ms),
        "overtaken_readings": way.overtaken,
        "steps": len(response),
        "unseen_steps": unseen,
        **_sound(evidence.sound),
        **_light(evidence.light, evidence.light_dance),
    }


def verdict(figures: dict[str, Any]) -> list[Limit]:
    """The figures that have limits."""
    free_p50 = figures["free_running_transport_ms"]["p50"]
    power_on_s, restart_s, kill_s = (
        figures[f"{name}_to_reading_s"]["p50"] for name in ("power_on", "restart", "kill")
    )
    power_on_limit_s = POWER_ON_AND_JOIN_S if figures["firmware"] else POWER_ON_S
    late_share = 100.0 * figures["late_ticks"] / max(1, figures["ticks"])
    light, sound = figures.get("hand_to_light_ms"), figures.get("hand_to_sound_ms")
    return [
        *(
            Limit(label, figures["transport_ms"][name], most, "ms")
            for label, (name, most) in TRANSPORT_MS.items()
        ),
        Limit(
            "transport, median, against free running / 4",
            figures["transport_ms"]["p50"],
            (free_p50 or 0.0) / 4,
            "ms",
        ),
        Limit(
            "response to a step, half of the way, median", figures["response_ms"]["p50"], RESPONSE_MS, "ms"
        ),
        Limit("tick, median", figures["tick_ms"]["p50"], 2.0, "ms"),
        Limit("tick, p99", figures["tick_ms"]["p99"], 6.0, "ms"),
        Limit("late ticks", late_share, 0.1, "%"),
        Limit("missing frames", 100.0 * figures["missing_frames"] / max(1, figures["ticks"]), 0.1, "%"),
        Limit("memory of the box", figures["rss_mb"], 120.0, "MB"),
        Limit("start to first frame", figures["start_to_first_frame_s"], 1.5, "s"),
        Limit("sensor's power-on to its reading in a frame, median", power_on_s, power_on_limit_s, "s"),
        Limit("box's restart to a reading in a frame, median", restart_s, RESTART_S, "s"),
        Limit("the same from its end, median", kill_s, RESTART_S, "s"),
        *([Limit("hand to sound, median", sound["p50"], SOUND_MS, "ms")] if sound else []),
        *([Limit("hand to light, median", light["p50"], LIGHT_MS, "ms")] if light else []),
        *([Limit("dance to light", figures["dance_to_light_ms"], DANCE_TO_LIGHT_MS, "ms")] if light else []),
    ]


def table(figures: dict[str, Any], limits: Sequence[Limit]) -> list[str]:
    """The report for a technician."""
    way, free, response = (
        figures["transport_ms"],
        figures["free_running_transport_ms"],
        figures["response_ms"],
    )
    lines = [
        "transport  " + "  ".join(f"{name} {_ms(value)}" for name, value in way.items()),
        f"  ({figures['readings']} readings, {figures['overtaken_readings']} of them overtaken by newer)",
        f"  running free  p50 {_ms(free['p50'])}  p99 {_ms(free['p99'])}",
        f"response to a step, half of the way  p50 {_ms(response['p50'])}   ({figures['steps']} steps, "
        f"{figures['unseen_steps']} more did not show)",
        *_sound_lines(figures),
        *_light_lines(figures),
        f"{figures['power_ons']} power-ons of a sensor, {figures['unanswered_power_ons']} more without a "
        f"reading; {figures['restarts']} restarts of the box",
        "tick by section, p50  "
        + "  ".join(f"{name} {_ms(part['p50'])}" for name, part in figures["sections_ms"].items()),
        "",
    ]
    for limit in limits:
        value = "nothing came" if limit.value is None else f"{limit.value:.2f} {limit.unit}"
        mark = "ok  " if limit.holds else "FAIL"
        lines.append(f"{mark}  {limit.label}: {value} (at most {limit.most:.2f} {limit.unit})")
    return lines


def _sound_lines(figures: dict[str, Any]) -> list[str]:
    if "hand_to_sound_ms" not in figures:
        return []
    sound, count = figures["hand_to_sound_ms"], figures["sound_steps"]
    still, late = figures["sound_changes_without_hand"], figures["late_sound_blocks"]
    found = f"p50 {_ms(sound['p50'])}  max {_ms(sound['max'])}"
    return [
        f"hand to sound, first audible change  {found}   ({count} steps; {still} while the hand was still; "
        f"{late} blocks late)"
    ]


def _light_lines(figures: dict[str, Any]) -> list[str]:
    if "hand_to_light_ms" not in figures:
        return []
    light = figures["hand_to_light_ms"]
    rate, count = figures["pictures_a_second"], figures["light_steps"]
    found = f"p50 {_ms(light['p50'])}  max {_ms(light['max'])}"
    return [
        f"hand to light, half of the way  {found}   ({count} steps, {rate:.0f} pictures a second)",
        f"dance to light, a hand that dances  {_ms(figures['dance_to_light_ms'])}",
    ]


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} ms"


def _transport(one: Run, settling_s: float) -> Transport:
    """The way of the readings that count: those sent after the first seconds."""
    begin = min((reading.sent_at for reading in one.readings), default=0.0) + settling_s
    return transport([reading for reading in one.readings if reading.sent_at >= begin], one.frames)


def _settling_s(locked: Run) -> float:
    """Three seconds, or half of a run that is shorter than six."""
    times = [reading.sent_at for reading in locked.readings]
    return min(SETTLING_S, (max(times) - min(times)) / 2.0) if times else SETTLING_S
