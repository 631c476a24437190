"""The figures of a soak and their limits: pure functions of the record."""

from __future__ import annotations

import platform
from typing import Any, NamedTuple

from hw_sim.soak.box import LATE_MS, LOAD
from hw_sim.soak.growth import growth
from hw_sim.soak.run import Soak
from hw_sim.soak.unit import Unit
from hw_sim.soak.viewers import Viewers

METHOD = (
    "A tick of the box is late when its frame left more than late_ms after the deadline that it names, "
    "by the kernel's time stamp of the datagram, or says itself that it is late; missing when no frame "
    "came for it. cyclictest runs at the same time with the same scheduling class, priority and period. "
    "A wake-up of it is late when it came later than late_ms less what the box's frames usually need "
    "(the median): a tick begun then would have left late; each whole period that it overslept counts "
    "as one more. Both are shares of all periods, and the box's may be 0.001 (0.1 %) above "
    "cyclictest's."
)
MOST_LATE_BEYOND = 0.001  # share of all slots, beyond cyclictest's figure for the machine
MOST_LATE_OF_MACHINE = 0.005  # above it the comparison says little
MOST_USUAL_MS = LATE_MS / 2.0  # a slower box would excuse its late ticks by any wake-up of the machine
MOST_GROWTH_MB = 1.0
# A sensor is away for 8 s at most, or starts anew; of a short run it may be half.
MOST_WITHOUT_READING_S = 30.0


class Limit(NamedTuple):
    """One demand: what it is about, what was found, whether it holds."""

    name: str
    found: str
    demanded: str
    holds: bool


def figures_of(soak: Soak) -> dict[str, Any]:
    """Everything for the report; shares are of all slots of 20 ms, 0..1."""
    frames, wakeups = soak.frames, soak.wakeups
    usual_ms = frames.delays.percentile(50) or 0.0
    limit_ms = LATE_MS - usual_ms
    slots, spoilt = frames.heard + frames.missing, frames.late + frames.missing
    machine_late = wakeups.later_than(limit_ms)
    said, before = soak.desk.said, soak.said_before
    temperatures = [look.temperature_c for look in soak.looks if look.temperature_c is not None]
    return {
        "machine": f"{platform.system()} {platform.release()} {platform.machine()}, "
        f"Python {platform.python_version()}",
        "method": METHOD,
        "planned_s": round(soak.planned_s, 1),
        "seconds": round(soak.seconds, 1),
        "slots": slots,
        "frames": frames.heard,
        "late": frames.late,
        "missing": frames.missing,
        "unheard": frames.unheard,
        "longest_gap_s": round(frames.longest_gap_s, 3),
        "late_ms": LATE_MS,
        "lateness_ms": frames.delays.figures(),
        "spoilt_share": _share(spoilt, slots),
        "cyclictest": {
            "complaint": wakeups.complaint,
            "slots": wakeups.slots,
            "late_after_ms": round(limit_ms, 1),
            "late": machine_late,
            "late_share": _share(machine_late, wakeups.slots),
            "latency_ms": wakeups.delays.figures(),
        },
        "spoilt_in_seconds_in_which_cyclictest_woke_late": _shared_seconds(soak),
        "counted_by_the_stage": None
        if said is None or before is None
        else {"late": said.late - before.late, "skipped": said.skipped - before.skipped},
        "processes": {unit.name: _process(unit, soak.seconds) for unit in soak.box.units},
        "temperature_c": {"first": temperatures[0], "max": max(temperatures)} if temperatures else None,
        "sensors": {
            "outages": soak.outages,
            "power_ons": soak.box.sensors.starts,
            "readings_in_frames": frames.readings,
            "longest_without_reading_s": round(frames.without_reading_s(soak.begun + soak.seconds), 1),
        },
        "guests_came_or_went": soak.guest_changes,
        "commands": dict(soak.desk.counts),
        "universes_of_light": soak.universes,
        "timecodes": soak.timecodes,
        "page": {"visits": soak.viewers.visits, "texts": soak.viewers.texts, "frames": soak.viewers.frames},
    }


def limits_of(soak: Soak) -> list[Limit]:
    """The limits."""
    figures = figures_of(soak)
    machine, box = figures["cyclictest"], figures["spoilt_share"]
    beyond = box - machine["late_share"]
    by_machine = machine["complaint"] or f"{100 * machine['late_share']:.3f} % of cyclictest's wake-ups"
    usual_ms = soak.frames.delays.percentile(50)
    found = [
        Limit(
            "usual lateness of a frame",
            "none was seen" if usual_ms is None else f"{usual_ms:.1f} ms",
            f"at most {MOST_USUAL_MS:g} ms",
            usual_ms is not None and usual_ms <= MOST_USUAL_MS,
        ),
        Limit(
            "late or missing ticks",
            f"{100 * box:.3f} % (the machine: {by_machine})",
            f"at most {100 * MOST_LATE_BEYOND:g} % beyond the machine's share",
            figures["slots"] > 0 and beyond <= MOST_LATE_BEYOND,
        ),
    ]
    grown = [one for unit in soak.box.units if (one := growth(unit, soak.seconds)) is not None]
    for one in grown:
        message = (
            f"{one.first.anonymous_mb:.1f} -> {one.last.anonymous_mb:.1f} MB, of which {one.own_mb:+.1f} MB "
            f"as it went on, {one.last.handles} handles"
        )
        found.append(
            Limit(
                f"own memory and handles of {one.name}",
                f"{message} in {_time(one.lived_s)}",
                f"at most {MOST_GROWTH_MB:g} MB more as it goes on, and no more handles or threads",
                one.own_mb <= MOST_GROWTH_MB and one.handles <= 0 and one.threads <= 0,
            )
        )
    untold = [u.name for u in soak.box.units if not u.is_away and u.name not in [one.name for one in grown]]
    if untold:
        found.append(Limit("memory", f"too short to tell: {', '.join(untold)}", "a longer run", False))
    without_s, most_s = (
        figures["sensors"]["longest_without_reading_s"],
        min(MOST_WITHOUT_READING_S, soak.seconds / 2.0),
    )
    found += [
        Limit(
            "readings",
            f"new ones in {soak.frames.readings} frames; at the longest none came for {_time(without_s)}",
            f"none for {_time(most_s)} at most",
            without_s <= most_s,
        ),
        Limit("commands", f"{soak.desk.counts['done']} done", "more than none", soak.desk.counts["done"] > 0),
        Limit("light", f"{soak.universes} universes came", "more than none", soak.universes > 0),
        Limit("timecode", f"{soak.timecodes} labels came", "more than none", soak.timecodes > 0),
        Limit("page", _watched(soak.viewers), "a status once a second at least", _page_holds(soak)),
    ]
    if soak.load_is_missing:
        missing = "stress-ng is not there. Install it: sudo apt-get install -y stress-ng"
        found.append(Limit("load", missing, "its load; or a soak that says --no-load", False))
    died = {unit.name: unit.deaths for unit in (*soak.box.units, soak.box.sensors) if unit.deaths}
    died |= {LOAD: soak.load_deaths} if soak.load_deaths else {}
    found.append(
        Limit(
            "processes",
            ", ".join(f"{name} ended {count} times" for name, count in died.items()) or "all lived",
            "no process ends unless it is killed",
            not died,
        )
    )
    return found


def table(soak: Soak) -> list[str]:
    """The report for people, line by line."""
    figures = figures_of(soak)
    lateness, machine = figures["lateness_ms"], figures["cyclictest"]
    counted = figures["counted_by_the_stage"]
    lines = [
        f"Danced {_time(soak.seconds)} of {_time(soak.planned_s)} on {figures['machine']}.",
        f"Ticks {figures['slots']}: late {figures['late']}, missing {figures['missing']}; "
        f"longest gap between two frames {1000 * figures['longest_gap_s']:.0f} ms.",
        f"A frame left after its deadline by {_percentiles(lateness)}.",
        f"The stage's own count: late {counted['late']}, skipped {counted['skipped']}."
        if counted
        else "The stage's own count did not come.",
        machine["complaint"]
        or f"cyclictest, same priority and period, woke late by {_percentiles(machine['latency_ms'])}.",
        f"{machine['late']} of its {machine['slots']} wake-ups came after {machine['late_after_ms']:g} ms, "
        "or not in their slot: a tick of the usual cost begun then would have left late.",
        f"{figures['spoilt_in_seconds_in_which_cyclictest_woke_late']} of the box's late and missing ticks "
        "fell into a second in which cyclictest, too, woke late by 10 ms or more, or into the one beside it.",
    ]
    for name, process in figures["processes"].items():
        away = ", what it needs is not on this machine" if process["away"] else ""
        lines.append(
            f"{name}: started {process['starts']} times, killed {process['kills']} times{away}; "
            f"{process['resources'] or 'lived too briefly to tell'}"
        )
    temperature = figures["temperature_c"]
    lines += [
        f"Warmest: {temperature['max']:.0f} degrees C."
        if temperature
        else "This machine reports no temperature.",
        f"Sensors: {soak.outages} outages, {soak.box.sensors.starts} power-ons. Receivers came or went "
        f"{soak.guest_changes} times. Commands: {soak.desk.counts['sent']} sent, {soak.desk.counts['done']} "
        f"done, {soak.desk.counts['refused']} refused. Universes of light: {soak.universes}.",
    ]
    if machine["late_share"] > MOST_LATE_OF_MACHINE:
        lines.append(
            f"The machine itself was late in {100 * machine['late_share']:.2f} % of all slots: comparing "
            "says little then. End what else runs on it, and soak again."
        )
    limits = limits_of(soak)
    lines += [
        f"{'ok  ' if limit.holds else 'FAIL'}  {limit.name}: {limit.found}; demanded: {limit.demanded}"
        for limit in limits
    ]
    holds = all(limit.holds for limit in limits)
    early = f"ended early, after {_time(soak.seconds)}: " if soak.seconds < soak.planned_s else ""
    return [
        *lines,
        f"Verdict: {early}" + ("everything holds." if holds else "it does not hold; see FAIL above."),
    ]


def _shared_seconds(soak: Soak) -> int:
    """Spoilt ticks in seconds in which cyclictest woke late, too, or in the one before or after."""
    machine = soak.wakeups.seconds.bad
    spoilt = soak.frames.seconds.bad.items()
    return sum(count for second, count in spoilt if any(machine[second + near] for near in (-1, 0, 1)))


def _process(unit: Unit, run_s: float) -> dict[str, Any]:
    grown = growth(unit, run_s)
    return {
        "starts": unit.starts,
        "kills": unit.kills,
        "deaths": unit.deaths,
        "away": unit.is_away,
        "resources": ""
        if grown is None
        else f"in {_time(grown.lived_s)} {grown.first.rss_mb:.1f} -> {grown.last.rss_mb:.1f} MB, "
        f"handles {grown.first.handles} -> {grown.last.handles}, "
        f"threads {grown.first.threads} -> {grown.last.threads}",
        "after_first_minute": None if grown is None else vars(grown.first),
        "at_the_end": None if grown is None else vars(grown.last),
        "lived_s": 0.0 if grown is None else round(grown.lived_s, 1),
    }


def _watched(viewers: Viewers) -> str:
    return f"{viewers.visits} visits, {viewers.texts} statuses and {viewers.frames} frames came"


def _page_holds(soak: Soak) -> bool:
    """A browser stays for most of the time, but for the seconds in which the console was killed."""
    return soak.viewers.frames > 0 and soak.viewers.texts >= soak.seconds


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 0.0


def _percentiles(found: dict[str, float | None]) -> str:
    if found["p50"] is None:
        return "nothing: none was seen"
    return ", ".join(f"{value:.1f} ms ({name})" for name, value in found.items())


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return " ".join(f"{count} {unit}" for count, unit in ((minutes, "min"), (rest, "s")) if count) or "0 s"
