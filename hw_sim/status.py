"""One line on the terminal while the emulator runs, and one at its beginning and its end."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.text import Text

from hw_sim.emulator import Emulator

NOTED = ("lost", "reordered", "duplicated", "corrupted", "unsent")


class StatusLine:
    """A context. The running line is drawn once a second, on a terminal only; `end` prints in any case."""

    def __init__(self, where: str, console: Console | None = None) -> None:
        self._where = where
        self._console = console or Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._next_at = 0.0
        self._sent = 0
        self._shown_at: float | None = None

    def __enter__(self) -> StatusLine:
        if self._console.is_terminal:
            self._live.start()
        else:
            self._console.print(f"Calling the box at {self._where}.", soft_wrap=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def show(self, emulator: Emulator, now: float) -> None:
        """Draw the line once a second. `now` in seconds."""
        if not self._console.is_terminal or now < self._next_at:
            return
        sent = emulator.counts["readings"]
        rate_hz = (sent - self._sent) / (now - self._shown_at) if self._shown_at is not None else 0.0
        lights = ", ".join(f"{device.name} (light {device.light})" for device in emulator.devices)
        self._live.update(
            Text(f"{lights} -> {self._where}  {rate_hz:.0f}/s  {_totals(emulator)}"), refresh=True
        )
        self._next_at, self._sent, self._shown_at = now + 1.0, sent, now

    def end(self, emulator: Emulator) -> bool:
        """Print what was sent; when nothing was, what to check. Whether a box took the sensors."""
        self._live.stop()
        self._console.print(
            f"{sensors(len(emulator.devices))} -> {self._where}: {_totals(emulator)}", soft_wrap=True
        )
        if not emulator.counts["sent"]:
            self._console.print(
                f"Nothing could be sent to {self._where}. Is it plugged in, and is the address right?",
                soft_wrap=True,
            )
        elif not emulator.counts["readings"]:
            self._console.print(
                f"No box took these sensors at {self._where}. Start one that reads the same key file "
                "(bunraku play --box FILE), or let it start the sensors itself: bunraku play --emulate",
                soft_wrap=True,
            )
        return bool(emulator.counts["readings"])


def sensors(count: int) -> str:
    """A number of sensors in words."""
    return "1 sensor" if count == 1 else f"{count or 'no'} sensors"


def _totals(emulator: Emulator) -> str:
    counts = emulator.counts
    parts = [f"{counts['readings']} readings sent"]
    parts += [f"{counts[note]} {note}" for note in NOTED if counts[note]]
    reboots = sum(device.reboots for device in emulator.devices)
    return ", ".join(parts + ([f"{reboots} reboots"] if reboots else []))
