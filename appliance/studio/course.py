"""The course of a training: how far it is, when it reports, saves and stops. Shared by every kind of it."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

from torch import Tensor


class Length(Protocol):
    """How long to train: steps where given, else minutes of wall time."""

    @property
    def steps(self) -> int: ...

    @property
    def minutes(self) -> float: ...


Line = TypeVar("Line")


class Course(ABC, Generic[Line]):
    """Counts steps and seconds over all its runs; a kind of training says what a step and a report are."""

    def __init__(self, length: Length) -> None:
        self._length_of_course = length
        self.step, self.seconds = 0, 0.0
        self.history: list[Line] = []

    @abstractmethod
    def train_step(self) -> dict[str, Tensor]:
        """One optimiser step; the losses by name."""

    @abstractmethod
    def line(self, means: Mapping[str, float]) -> Line:
        """A line of history from the mean losses since the last one."""

    @property
    def fraction(self) -> float:
        """How much of the training is done, 0..1."""
        if self._length_of_course.steps:
            return min(self.step / self._length_of_course.steps, 1.0)
        return min(self.seconds / (self._length_of_course.minutes * 60), 1.0)

    def run(
        self,
        report: Callable[[Line], None],
        save: Callable[[], None],
        report_every_s: float = 15.0,
        save_every_s: float = 120.0,
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Train until done or stop() says so; reports and saves at intervals of wall time."""
        sums: dict[str, float] = {}
        counted = 0
        began, offset = time.monotonic(), self.seconds
        last_report = last_save = began
        while self.fraction < 1.0 and not stop():
            for name, value in self.train_step().items():
                sums[name] = sums.get(name, 0.0) + float(value)
            counted += 1
            now = time.monotonic()
            self.seconds = offset + now - began
            if now - last_report >= report_every_s or self.fraction >= 1.0:
                line = self.line({name: value / counted for name, value in sums.items()})
                self.history.append(line)
                report(line)
                sums, counted, last_report = {}, 0, now
            if now - last_save >= save_every_s:
                save()
                last_save = now
        save()
