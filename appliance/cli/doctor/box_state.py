"""The box itself: its units, its stage, its watchdog, its clock."""

from __future__ import annotations

import ctypes
import datetime
from collections.abc import Iterator

from appliance.box.child import finished
from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView
from appliance.release.choice import CHOSEN, RUN

_EARLIEST = 2026  # this program did not exist before
_TIME_ERROR = 5  # adjtimex(2): the clock is not synchronized
_ASK_S = 3.0
_LATE_SHARE = 0.001
_SEEN = frozenset(  # by the audience, as long as they are in force
    (
        *("sensor-silent", "cable-away", "address-absent", "sensor-not-let-in", "receiver-gone"),
        *("network-not-finite", "frames-not-shared", "source-late", "stage-hung", "dmx-away", "lights-safe"),
        *("picture-black", "sound-card-away", "no-sound-card", "sound-rests", "motion-not-made"),
    )
)


def stage(host: HostView) -> Iterator[Finding]:
    """The dance that runs here."""
    if host.stage is None:
        if host.at(RUN / CHOSEN).exists():  # the units run, or should
            yield wrong(
                "stage",
                "Nothing dances, though the box is on: the audience sees black.",
                "`journalctl -b -u bunraku-stage` says why. No time? The second box.",
            )
        else:
            yield ok("stage", "Nothing dances here now.")
        return
    health = host.stage.health
    ticks, late = (
        int(health.get("ticks") or 0),
        int(health.get("late") or 0) + int(health.get("skipped") or 0),
    )
    message = f"{health.get('rate_hz', 0.0):.1f} Hz; {late} of {ticks} ticks late or skipped."
    if ticks and late > _LATE_SHARE * ticks:
        yield better("stage", f"{message} A few do not show.", "Look at wake-ups and other programs here.")
    else:
        yield ok("stage", message)
    for complaint in health.get("complaints") or []:
        yield better("stage", *_halves(str(complaint), "stage"))
    for process, fallback in host.stage.fallbacks:
        if fallback.active and process != "preflight":  # its refusals are shown with the show
            judged = wrong if fallback.name in _SEEN or fallback.name.endswith("-died") else better
            about = f" ({fallback.about})" if fallback.about else ""
            yield judged(f"{process}: {fallback.name}{about}", *_halves(fallback.message, process))


def _halves(sentences: str, process: str) -> tuple[str, str]:
    """Splits a report into its account and its cure, which is the last sentence."""
    happened, _, cure = sentences.rpartition(". ")
    if not happened:
        return sentences, f"`journalctl -b -u bunraku-{process}` says more."
    return f"{happened}.", cure


def units(host: HostView) -> Iterator[Finding]:
    """systemd's report on the box's units."""
    if not host.is_here or not host.at("/run/systemd/system").is_dir():
        return
    for unit in _systemd_properties("bunraku*.service", "bunraku.target"):
        name, state = unit.get("Id", ""), unit.get("ActiveState", "")
        restarts = unit.get("NRestarts", "0")
        if state == "failed":
            yield wrong(
                name, f"It has failed ({unit.get('Result')}).", f"`journalctl -b -u {name}` says why."
            )
        elif restarts not in ("", "0"):
            yield better(
                name,
                f"{state}; it was started again {restarts} times since the box was switched on.",
                f"`journalctl -b -u {name}` says why.",
            )
        else:
            yield ok(name, f"{state} ({unit.get('SubState')}).")


def _systemd_properties(*patterns: str) -> list[dict[str, str]]:
    properties = "--property=Id,ActiveState,SubState,NRestarts,Result"
    done = finished(("systemctl", "show", properties, *patterns), _ASK_S)
    blocks = [block for block in done.stdout.split("\n\n") if block.strip()]
    return [dict(line.split("=", 1) for line in block.splitlines() if "=" in line) for block in blocks]


def watchdog(host: HostView) -> Iterator[Finding]:
    """Does a machine that hangs as a whole restart itself?"""
    devices = host.found("/sys/class/watchdog/watchdog[0-9]*")
    cure = "RuntimeWatchdogSec=10s in /etc/systemd/system.conf; the installed box does that by itself."
    if not devices:
        yield better(
            "watchdog",
            "This machine has none: if it hangs as a whole, it stays so.",
            "A Raspberry Pi or a NUC has one.",
        )
    elif any(host.text(device / "state") == "active" for device in devices):
        seconds = host.text(devices[0] / "timeout")
        yield ok("watchdog", f"It restarts the machine after {seconds} s of silence.")
    else:
        yield better("watchdog", "It is not in use: a machine that hangs as a whole stays so.", cure)


def clock(host: HostView) -> Iterator[Finding]:
    """The dance needs none; the times in the journal do."""
    if not host.is_here:
        return
    year, what = datetime.datetime.now(datetime.UTC).year, "clock"
    if year < _EARLIEST:
        yield better(
            what,
            f"It says {year}. The dance does not mind; journals and logs carry wrong dates.",
            "A network with the time, or a battery for the clock (Pi 5: its socket J5).",
        )
    elif _is_synchronized():
        yield ok(what, "It is kept right by a time server.")
    else:
        yield ok(what, "No time server sets it. The dance does not mind; dates may be off by minutes.")


def _is_synchronized() -> bool:
    """adjtimex(2) with nothing to set: its result is the state of the clock."""
    empty = ctypes.create_string_buffer(512)  # struct timex is shorter
    return int(ctypes.CDLL(None).adjtimex(empty)) != _TIME_ERROR
