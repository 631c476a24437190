"""The box's health for Prometheus, in its text format 0.0.4."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_OF_STATUS = {  # field: name, kind, meaning
    "rate_hz": ("rate_hertz", "gauge", "Frames a second."),
    "late": ("late_ticks_total", "counter", "Ticks that left late since the stage started."),
    "skipped": ("skipped_ticks_total", "counter", "Ticks that were left out since the stage started."),
    "coding": ("coding_iterations", "gauge", "Coding iterations in force."),
    "level": ("level", "gauge", "Factor on the brightness of picture and lights, 0 to 1."),
    "panic": ("panic", "gauge", "1 while panic is in force."),
    "blackout": ("blackout", "gauge", "1 while a blackout is in force."),
    "refused": ("commands_refused_total", "counter", "Commands that were not carried out."),
    "fallbacks": ("fallbacks_active", "gauge", "Fallbacks in force."),
}
_MEASURED = {  # the same, left out while unknown (negative)
    "tick_p50_ms": ("tick_p50_milliseconds", "gauge", "Half of the ticks took no longer."),
    "tick_p99_ms": ("tick_p99_milliseconds", "gauge", "99 of 100 ticks took no longer."),
    "temperature_c": ("temperature_celsius", "gauge", "Of the processor."),
    "uptime_s": ("uptime_seconds", "gauge", "Since the stage started."),
}
_OF_SENSOR = {
    "heard": ("sensor_heard", "1 while the sensor sends."),
    "rate_hz": ("sensor_rate_hertz", "Readings a second."),
    "loss": ("sensor_loss_ratio", "Readings lost on the way, 0 to 1."),
    "battery": ("sensor_battery_percent", "Last known battery."),
}


def metrics(value: dict[str, Any]) -> str:
    """`value`: as the page gets it; before the first answer of show control there is little to tell."""
    return "".join(f"{line}\n" for line in _lines(value))


def _lines(value: dict[str, Any]) -> Iterator[str]:
    status = value.get("status") or {}
    is_up = int(value.get("frames") == "fresh")
    yield from _metric("up", "gauge", "1 while frames leave the stage.", [("", is_up)])
    for field, (name, kind, meaning) in _OF_STATUS.items():
        if field in status:
            yield from _metric(name, kind, meaning, [("", status[field])])
    for field, (name, kind, meaning) in _MEASURED.items():
        if status.get(field, -1.0) >= 0:
            yield from _metric(name, kind, meaning, [("", status[field])])
    sensors = value.get("sensors", ())
    for field, (name, meaning) in _OF_SENSOR.items():
        known = [(_label("sensor", one["name"]), one[field]) for one in sensors if one[field] is not None]
        yield from _metric(name, "gauge", meaning, known)
    happened = [
        (_label("name", one["name"], "process", one["process"]), one["times"])
        for one in value.get("fallbacks", ())
    ]
    yield from _metric("fallbacks_total", "counter", "How often each fallback happened.", happened)


def _metric(name: str, kind: str, meaning: str, values: list[tuple[str, float]]) -> Iterator[str]:
    if values:
        yield f"# HELP bunraku_{name} {meaning}"
        yield f"# TYPE bunraku_{name} {kind}"
        for labels, value in values:
            yield f"bunraku_{name}{labels} {float(value):.15g}"


def _label(*pairs: str) -> str:
    escaped = [one.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") for one in pairs]
    names, values = escaped[::2], escaped[1::2]
    return "{" + ",".join(f'{name}="{value}"' for name, value in zip(names, values, strict=True)) + "}"
