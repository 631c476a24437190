"""Real time and the processor: rights, wakeup latency, others, pace, temperature, power."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator

from appliance.box.realtime import borrowed_priority
from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView, output_of
from appliance.cli.doctor.sample import SECONDS, Sample

LATE_MS, VERY_LATE_MS = 5.0, 15.0
WARM_C, HOT_C = 70.0, 80.0
BUSY_SHARE = 0.25
_FIFO = 1
_UNITS = "The installed units do that by themselves; for a trial by hand: `sudo .venv/bin/bunraku play`."


def realtime_rights(host: HostView) -> Iterator[Finding]:
    """May the stage run before all other programs, and does it?"""
    what, priority = "real time", host.box.realtime.priority
    if not host.box.realtime.enabled:
        yield better(
            what,
            "The box file says `realtime: {enabled: false}`. Other programs can hold up the dance.",
            "Leave that out.",
        )
    elif host.stage is not None:
        fields = (host.text(f"/proc/{host.stage.pid}/stat") or "").rpartition(")")[2].split()
        if len(fields) > 38 and int(fields[38]) == _FIFO:
            yield ok(what, f"The stage dances with real-time priority {fields[37]}.")
        else:
            yield wrong(
                what,
                "The stage dances without real-time priority. The audience sees pauses on a busy machine.",
                f"Start it with `ulimit -r {priority}` or LimitRTPRIO={priority}. {_UNITS}",
            )
    elif host.is_here and not _may_take(priority):
        yield wrong(
            what,
            "This user may take no real-time priority. The audience would see pauses on a busy machine.",
            f"`ulimit -r {priority}`, or LimitRTPRIO={priority} in the unit. {_UNITS}",
        )
    elif host.is_here:
        yield ok(what, f"Priority {priority} can be had.")


def _may_take(priority: int) -> bool:
    with borrowed_priority(priority):
        return bool(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)


def locked_memory(host: HostView) -> Iterator[Finding]:
    """A tick must not wait for the disk."""
    what, limit = "locked memory", resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    cure = "`ulimit -l unlimited`, or LimitMEMLOCK=infinity in the unit."
    if host.stage is not None:
        status = host.text(f"/proc/{host.stage.pid}/status") or ""
        locked = [line.split()[1] for line in status.splitlines() if line.startswith("VmLck:")]
        if locked and int(locked[0]) > 0:
            yield ok(what, "The stage's memory stays where it is.")
        else:
            yield better(what, "The stage's memory is not locked: a tick can wait for the disk.", cure)
    elif host.is_here and limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        yield better(what, "This user may not lock memory: a tick can wait for the disk.", cure)
    elif host.is_here:
        yield ok(what, "It can be had.")


def wakeup_latency(seen: Sample) -> Iterator[Finding]:
    """How late a thread like the stage's wakes: no software can be more punctual than that."""
    what, late = "wake-ups", seen.late_ms
    worst = late[-1]
    of = "with real-time priority" if seen.real_time else "without the real-time priority of the stage"
    message = (
        f"{len(late)} in {SECONDS:g} s, {of}: half came within {late[len(late) // 2]:.2f} ms, 99 % within "
        f"{late[len(late) * 99 // 100]:.2f} ms, the latest {worst:.1f} ms after its time."
    )
    very_late = sum(one > VERY_LATE_MS for one in late)
    cure = (
        "Look at what else runs here (below), at power saving in the firmware, at a virtual "
        "machine's neighbours. "
        "`cyclictest -p 69 -i 20000` (Debian package rt-tests) shows it for longer."
    )
    if very_late > 0.01 * len(late):
        yield wrong(what, f"{message} {very_late} were late by more than a frame may be.", cure)
    elif worst > LATE_MS:
        yield better(what, f"{message} Some frames will leave late; a few do not show.", cure)
    else:
        yield ok(what, message)


def others(seen: Sample) -> Iterator[Finding]:
    """Other programs that use the cores."""
    what = "other programs"
    busy = [(name, pid, share) for name, pid, share in seen.shares if share > BUSY_SHARE]
    total = sum(share for _, _, share in seen.shares)
    names = ", ".join(
        f"{name} (process {pid}, {100 * share:.0f} % of a core)" for name, pid, share in busy[:4]
    )
    if busy:
        verdict = wrong if total > 0.8 * seen.cores else better
        yield verdict(
            what,
            f"{names}. The dance has priority over them; projector and lights do not.",
            "End what the show does not need; `top` shows more.",
        )
    else:
        yield ok(what, f"They use {100 * total:.0f} % of one of {seen.cores} cores.")


def interrupts(seen: Sample) -> Iterator[Finding]:
    """Load that takes precedence over the dance: interrupts, and the host of a virtual machine."""
    if seen.interrupts > BUSY_SHARE:
        yield better(
            "interrupts",
            f"They take {100 * seen.interrupts:.0f} % of a core, and the dance waits for them.",
            "`watch -d cat /proc/interrupts` shows the source: often network broadcasts, or a USB hub.",
        )
    else:
        yield ok("interrupts", f"They take {100 * seen.interrupts:.0f} % of a core.")
    if seen.stolen > 0.02:
        yield better(
            "virtual machine",
            f"Its host gives {100 * seen.stolen:.0f} % of a core to others. Frames come late meanwhile.",
            "Run a show on a machine that does nothing else.",
        )


def governor(host: HostView) -> Iterator[Finding]:
    """How fast the processor runs between two ticks."""
    files = host.found("/sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor")
    names = {host.text(file) or "" for file in files}
    what = "processor's pace"
    if not names:
        yield ok(what, "Nothing slows it down, as far as it tells.")
    elif names == {"performance"}:
        yield ok(what, "It is always at its full pace.")
    else:
        yield better(
            what,
            f"It is set by '{', '.join(sorted(names))}': ticks after a pause take longer.",
            "`echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor`, at each "
            "power-on.",
        )


def temperature(host: HostView) -> Iterator[Finding]:
    """The warmest of all sensors that Linux knows."""
    found = [host.number(zone) for zone in host.found("/sys/class/thermal/thermal_zone*/temp")]
    degrees = [number / 1000.0 for number in found if number is not None]
    what = "temperature"
    if not degrees:
        yield ok(what, "This machine does not tell it.")
        return
    message = f"{max(degrees):.0f} degrees C."
    cure = "Air: a fan that turns, a free unit above and below in the rack, no amplifier beneath."
    if max(degrees) >= HOT_C:
        yield wrong(what, f"{message} It slows itself down now: frames come late.", cure)
    elif max(degrees) >= WARM_C:
        yield better(what, f"{message} It slows itself down from {HOT_C:g} on.", cure)
    else:
        yield ok(what, message)


def power(host: HostView) -> Iterator[Finding]:
    """A Raspberry Pi says whether its supply is too weak (bits of `vcgencmd get_throttled`)."""
    files = host.found("/sys/devices/platform/soc*/soc*firmware/get_throttled")
    bits = next((int(text, 16) for file in files if (text := host.text(file))), None)
    if bits is None and host.is_here:  # Raspberry Pi OS has the program, other kernels have no such file
        reported = output_of("vcgencmd", "get_throttled").strip().partition("throttled=")[2]
        bits = int(reported, 16) if reported else None
    alarms = [
        host.number(chip.with_name("in0_lcrit_alarm"))
        for chip in host.found("/sys/class/hwmon/hwmon*/name")
        if host.text(chip) == "rpi_volt"
    ]
    what, supply = (
        "power",
        "Use the maker's own supply (Pi 5: 27 W), a short cable, no hub that feeds on the box.",
    )
    if bits is None and not alarms:
        slowed = [
            host.number(file) or 0
            for file in host.found("/sys/devices/system/cpu/cpu*/thermal_throttle/package_throttle_count")
        ]
        if any(slowed):
            yield better(
                what,
                f"The processor slowed itself down {max(slowed)} times since it was switched on.",
                "Air, as for a machine that is too warm.",
            )
        return
    bits = bits or 0
    if bits & 0x1 or any(alarms):
        yield wrong(what, "The voltage is too low now. The box may restart in mid-show.", supply)
    elif bits & 0xE:
        yield wrong(what, "The processor is slowed down now. Frames come late.", f"Air; and: {supply}")
    elif bits & 0x10000:
        yield better(what, "The voltage has been too low since the box was switched on.", supply)
    elif bits & 0xE0000:
        yield better(what, "The processor has been slowed down since the box was switched on.", "Air.")
    else:
        yield ok(what, "The supply holds.")
