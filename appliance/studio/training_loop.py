"""The training loop of both networks: progress, averaged weights, reports, checkpoints, stop and resume."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import torch
from torch import Tensor, nn

from appliance.pose.whole_file import written_whole
from appliance.studio.processes import Processes
from appliance.studio.studio_error import StudioError

ALONE, PROCESSOR = Processes(), torch.device("cpu")


class Duration(Protocol):
    """How to train: for `steps` steps if that is not 0, else for minutes of wall time.

    smoothing: of the averaged weights, 0 to 1; batch: of all processes; mixed: precision, on a GPU.
    """

    @property
    def steps(self) -> int: ...

    @property
    def minutes(self) -> float: ...

    @property
    def smoothing(self) -> float: ...

    @property
    def batch(self) -> int: ...

    @property
    def mixed(self) -> bool: ...


Report = TypeVar("Report")


def mixed_precision(device: torch.device, wanted: bool) -> torch.autocast:
    """Inside it networks compute in bfloat16 on a GPU, their weights stay fp32; no effect on the processor.

    Losses belong outside: 8 bits of precision are a third of a degree.
    """
    return torch.autocast(device.type, torch.bfloat16, enabled=wanted and device.type == "cuda")


class TrainingLoop(ABC, Generic[Report]):
    """Counts steps and seconds over all runs; a kind of training defines what a step and a report are."""

    report_type: type[Report]
    saved: tuple[str, ...]  # networks and optimisers in a checkpoint

    def __init__(
        self, duration: Duration, processes: Processes = ALONE, device: torch.device = PROCESSOR
    ) -> None:
        """Raises StudioError for a batch that the processes cannot share evenly."""
        if duration.batch % processes.count:
            raise StudioError(
                f"{processes.count} processes cannot share a batch of {duration.batch} evenly. Start another "
                "number of them: torchrun --nproc-per-node 2, 4 or 8."
            )
        self._duration, self.processes, self.device = duration, processes, device
        self.mixed = mixed_precision(device, duration.mixed)
        self.step, self.seconds = 0, 0.0
        self.history: list[Report] = []
        self.origin: dict[str, Any] = {}  # what the training data came from

    @abstractmethod
    def train_step(self) -> dict[str, Tensor]:
        """One optimiser step; returns the losses by name."""

    @abstractmethod
    def report(self, means: Mapping[str, float]) -> Report:
        """A line of history: the mean losses since the previous one, and the error on held-out takes."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """The checkpoint: everything that a resumed training needs."""

    @property
    def fraction(self) -> float:
        """How much of the training is done, 0..1."""
        if self._duration.steps:
            return min(self.step / self._duration.steps, 1.0)
        return min(self.seconds / (self._duration.minutes * 60), 1.0)

    def run(
        self,
        report: Callable[[Report], None],
        save: Callable[[], None],
        report_every_s: float = 15.0,
        save_every_s: float = 120.0,
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Train until done or stop() returns True; reports and saves at intervals of wall time.

        The leading process's clock and stop() count for all; only that process is told to report and save.
        """
        agreed, leads = self.processes.agreed, self.processes.leads
        sums: dict[str, Tensor] = {}  # added up where they are computed: no step waits for a GPU
        counted = 0
        began, offset = time.monotonic(), self.seconds
        last_report = last_save = self.seconds
        while self.fraction < 1.0 and not agreed(stop()):
            for name, value in self.train_step().items():
                sums[name] = value.double() + sums.get(name, 0.0)
            counted += 1
            now = self.seconds = agreed(offset + time.monotonic() - began)
            if now - last_report >= report_every_s or self.fraction >= 1.0:
                means = self.processes.mean(torch.stack(list(sums.values())).cpu()) / counted
                line = self.report(dict(zip(sums, means.tolist(), strict=True)))
                self.history.append(line)
                if leads:
                    report(line)
                sums, counted, last_report = {}, 0, now
            if now - last_save >= save_every_s and leads:
                save()
                last_save = now
        if leads:
            save()

    def save_checkpoint(self, path: Path) -> None:
        """Write the whole state; the old file stays until the new one is complete. Raises StudioError."""
        try:
            with written_whole(path) as beside:
                torch.save(self.state(), beside)
        except (OSError, RuntimeError) as error:  # torch's writer says RuntimeError for a full disk
            kept = "The one before is kept: make" if path.exists() else "Make"
            message = f"{path}: the checkpoint cannot be written; is the disk full?"
            raise StudioError(f"{message} {kept} room, then continue with --resume.") from error

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a checkpoint."""
        for name in self.saved:
            getattr(self, name).load_state_dict(state[name])
        torch.set_rng_state(state["random"].cpu())
        self.step, self.seconds = state["step"], state["seconds"]
        self.history = [self.report_type(**line) for line in state["history"]]

    def _descend(self, loss: Tensor, optimizer: torch.optim.Optimizer, *bounded: nn.Module) -> None:
        """One step of an optimiser down the gradient of all processes' losses; of the bounded networks it is
        at most 1 long.
        """
        optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.processes.average_gradients(one for group in optimizer.param_groups for one in group["params"])
        for network in bounded:
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()

    def _shared_state(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, name).state_dict() for name in self.saved},
            "random": torch.get_rng_state(),
            "origin": self.origin,
            "step": self.step,
            "seconds": self.seconds,
            "history": [asdict(line) for line in self.history],  # type: ignore[call-overload]
        }

    def _cosine(self) -> float:
        """Share of the learning rate, from 1 at the start to 0 at the end."""
        return 0.5 * (1 + math.cos(math.pi * self.fraction))

    @torch.no_grad()
    def _average_weights(self, averaged: nn.Module, network: nn.Module) -> None:
        """Move the averaged weights towards the network's; call before `step` is counted."""
        keep = min(self._duration.smoothing, (self.step + 1) / (self.step + 10))
        torch._foreach_lerp_(list(averaged.parameters()), list(network.parameters()), 1 - keep)
