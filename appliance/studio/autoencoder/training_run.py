"""Runs a training: progress, checkpoints, pictures, and a stop that loses nothing."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn
from torch import nn

from appliance.pose.counted import counted
from appliance.pose.whole_file import write_text_whole
from appliance.studio.autoencoder.training import Report, Training
from appliance.studio.data.dataset import window_starts
from appliance.studio.evaluation.coders import TorchCoder
from appliance.studio.evaluation.pictures import draw_losses, draw_reconstruction
from appliance.studio.training_loop import Report as AnyReport
from appliance.studio.training_loop import TrainingLoop

LOSSES_PICTURE = Path("pictures") / "losses.png"
REPORT_S = 30.0  # measuring on held-out takes costs a large LSTM seconds
FIRST_STRIP_S, STRIP_SHARE = 60.0, 0.1  # a filmstrip after a minute and at every tenth of the training


class TrainingRun:
    """Runs a training in its folder: checkpoint.pt, training.json, pictures/."""

    def __init__(self, training: Training, folder: Path, console: Console) -> None:
        self.training, self.folder, self.console = training, folder, console
        self.checkpoint = folder / "checkpoint.pt"
        self._strip_at: float | None = None

    def run(self) -> bool:
        """Train until done or stopped (Ctrl-C, SIGTERM). True if done; always writes the checkpoint."""
        return run_shown(
            self.training, "training", self.console, self._line, self._save, self._keep, REPORT_S
        )

    def _line(self, report: Report) -> str:
        held = report.held_out_degrees
        off = [] if held is None else [f"{held:.2f} degrees on held-out takes"]
        return ", ".join([*off, *(f"{name} {value:.3g}" for name, value in report.losses.items())])

    def _keep(self, report: Report) -> None:
        """Store a line of history; draw a filmstrip if one is due."""
        self._write_history()
        if self._strip_is_due(report):
            self._strip_at = report.fraction
            self._draw_strip(report)

    def _strip_is_due(self, report: Report) -> bool:
        if self._strip_at is None:
            return report.seconds >= FIRST_STRIP_S
        return report.fraction - self._strip_at >= STRIP_SHARE

    def _draw_strip(self, report: Report) -> None:
        dataset = self.training.dataset
        window = self.training.settings.window
        takes = dataset.measured_on(window)
        take = max(takes, key=lambda take: len(window_starts(take, window=window)))
        minutes, steps = counted(round(report.seconds / 60), "minute"), counted(report.step, "step")
        title = f"{take.name} after {minutes} ({steps})"
        path = self.folder / "pictures" / f"filmstrip_{round(100 * report.fraction):03d}.png"
        coder = TorchCoder(self.training.averaged, dataset.moving_names, {})
        draw_reconstruction(path, coder, take, title)

    def _save(self) -> None:
        self.training.save_checkpoint(self.checkpoint)
        self._write_history()
        if self.training.history:
            history = [asdict(line) for line in self.training.history]
            draw_losses(self.folder / LOSSES_PICTURE, history)

    def _write_history(self) -> None:
        record = {
            "settings": asdict(self.training.settings),
            "parameters": parameters(self.training.autoencoder.network),
            "history": [asdict(line) for line in self.training.history],
        }
        write_text_whole(self.folder / "training.json", json.dumps(record, indent=1) + "\n")


def run_shown(
    training: TrainingLoop[AnyReport],
    name: str,
    console: Console,
    line: Callable[[AnyReport], str],
    save: Callable[[], None],
    keep: Callable[[AnyReport], None] = lambda report: None,
    report_every_s: float = 15.0,
) -> bool:
    """Train until done or stopped (Ctrl-C, SIGTERM), with a progress bar, or with lines without a terminal.

    line: a report in words; keep: what else is done with it. True if done; `save` is called in any case.
    """
    columns = [SpinnerColumn(), TextColumn(name), BarColumn(), TaskProgressColumn()]
    message = TextColumn("{task.fields[message]}")
    shown = Progress(*columns, message, console=console, disable=not console.is_terminal)
    with stop_signals() as stop_asked, shown as progress:
        console.print("Ctrl-C stops without losing anything.")
        bar = progress.add_task(name, total=1.0, message="")
        steps_at_start, began, newest = training.step, time.monotonic(), ""

        def stop() -> bool:
            done = training.step - steps_at_start
            if done % 10 == 0:
                pace = done / max(time.monotonic() - began, 1e-6)
                left = _clock(time_left_s(training.seconds, training.fraction))
                said = f"{pace:.1f} steps/s, {left} left. {newest}"
                progress.update(bar, completed=training.fraction, message=said)
            return stop_asked()

        def report(one: AnyReport) -> None:
            nonlocal newest
            newest = ", ".join(line(one).split(", ")[:4])
            if not console.is_terminal:
                said = f"{100 * training.fraction:5.1f} %  step {training.step}  {line(one)}"
                console.print(said, highlight=False, soft_wrap=True)
            keep(one)

        training.run(report, save, report_every_s, stop=stop)
        progress.update(bar, completed=training.fraction)
    return training.fraction >= 1.0


def parameters(network: nn.Module) -> int:
    """The number of learned parameters."""
    return sum(parameter.numel() for parameter in network.parameters())


def time_left_s(seconds: float, fraction: float) -> float:
    """Remaining seconds at the pace so far."""
    return seconds * (1 - fraction) / fraction if fraction > 0 else 0.0


@contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Yields a function: whether Ctrl-C or SIGTERM arrived. A second signal stops at once."""
    asked = False

    def ask(number: int, frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
