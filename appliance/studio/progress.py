"""How far a long piece of work is: a bar on a terminal, else a line when it begins and every few seconds."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress, track

T = TypeVar("T")
EVERY_S = 8.0


def shown(
    parts: Iterable[T],
    description: str,
    console: Console | None,
    count: int | None = None,
    now: Callable[[], float] = time.monotonic,
) -> Iterator[T]:
    """The parts one by one; description: 'standing'; count: of the parts, if they do not know it themselves.

    Without a console nothing is said.
    """
    if console is None:
        yield from parts
        return
    if console.is_terminal:
        yield from track(parts, description, count, console=console, transient=True)
        return
    total = len(parts) if count is None else count  # type: ignore[arg-type]
    console.print(f"{description} ...", highlight=False)
    said = now()
    for number, part in enumerate(parts, 1):
        yield part
        if number < total and now() - said >= EVERY_S:
            console.print(f"{description}: {100 * number / total:.0f} %", highlight=False)
            said = now()


@contextmanager
def reported(
    console: Console | None, count: int | None = None, now: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[str], None]]:
    """Yields what is called before each part with its description; count: how often, None: nobody knows."""
    if console is None:
        yield lambda description: None
        return
    if console.is_terminal:
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("", total=count)
            yield lambda description: bar.update(task, advance=1, description=description)
        return
    calls, said = 0, -math.inf

    def say(description: str) -> None:
        nonlocal calls, said
        if now() - said >= EVERY_S:
            share = "" if count is None else f"{100 * min(calls / count, 1):.0f} %  "
            console.print(f"{share}{description}", highlight=False)
            said = now()
        calls += 1

    yield say


@contextmanager
def logged(console: Console) -> Iterator[None]:
    """A context in which what the studio logs is shown there, as it is."""
    logger, handler = logging.getLogger("appliance.studio"), _OnConsole(console)
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)


class _OnConsole(logging.Handler):
    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(self.format(record), markup=False, highlight=False, soft_wrap=True)


@contextmanager
def doing(description: str, console: Console) -> Iterator[None]:
    """Says what goes on, where there are no parts to count."""
    if console.is_terminal:
        with console.status(description):
            yield
    else:
        console.print(f"{description} ...", highlight=False)
        yield
