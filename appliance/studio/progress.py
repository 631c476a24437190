"""How far a long piece of work is: a bar on a terminal, else a line when it begins and every few seconds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress, track

T = TypeVar("T")
EVERY_S = 15.0


def shown(
    parts: Iterable[T],
    words: str,
    console: Console | None,
    count: int | None = None,
    now: Callable[[], float] = time.monotonic,
) -> Iterator[T]:
    """The parts one by one; words: 'standing'; count: of the parts, if they do not know it themselves.

    Without a console nothing is said.
    """
    if console is None:
        yield from parts
        return
    if console.is_terminal:
        yield from track(parts, words, count, console=console, transient=True)
        return
    total = len(parts) if count is None else count  # type: ignore[arg-type]
    console.print(f"{words} ...", highlight=False)
    said = now()
    for number, part in enumerate(parts, 1):
        yield part
        if number < total and now() - said >= EVERY_S:
            console.print(f"{words}: {100 * number / total:.0f} %", highlight=False)
            said = now()


@contextmanager
def told(
    console: Console | None, count: int | None = None, now: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[str], None]]:
    """Yields what is called before each part with its words; count: how often, None: nobody knows."""
    if console is None:
        yield lambda words: None
        return
    if console.is_terminal:
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("", total=count)
            yield lambda words: bar.update(task, advance=1, description=words)
        return
    calls, said = 0, -math.inf

    def say(words: str) -> None:
        nonlocal calls, said
        if now() - said >= EVERY_S:
            share = "" if count is None else f"{100 * min(calls / count, 1):.0f} %  "
            console.print(f"{share}{words}", highlight=False)
            said = now()
        calls += 1

    yield say


@contextmanager
def doing(words: str, console: Console) -> Iterator[None]:
    """Says what goes on, where there are no parts to count."""
    if console.is_terminal:
        with console.status(words):
            yield
    else:
        console.print(f"{words} ...", highlight=False)
        yield
