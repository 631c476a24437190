"""Answers of a separate process: for questions that would load too much into the page's process."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import Mapping
from typing import Any

from aiohttp import web

from appliance.box.child import environment

LARGEST = 8 << 20  # bytes of an answer
_awaited: set[asyncio.Task[int]] = set()  # the ends of children; a task that nothing refers to may vanish


async def answer_of(function: str, patience_s: float, **keywords: Any) -> bytes:
    """The answer of a function of cli/page_calls.py with these keywords, as JSON, LARGEST bytes at most.

    Raises 404 with its own sentence where it refuses, 503 where it takes too long or says too much.
    """
    command = sys.executable, "-m", "appliance.cli.page_calls", function
    said = json.dumps(keywords).encode()
    env = environment(OPENBLAS_NUM_THREADS="1")
    try:
        status, answer, troubles = await output_of(*command, patience_s=patience_s, said=said, env=env)
    except TimeoutError:
        raise web.HTTPServiceUnavailable(text="Reading this took too long. Try again in a moment.") from None
    if status:
        message = troubles.decode(errors="replace").strip().rpartition("\n")[2]
        raise web.HTTPNotFound(text=message.removeprefix("bunraku: ") or "This cannot be read.")
    if len(answer) > LARGEST:
        raise web.HTTPServiceUnavailable(text="That is too much at once.")
    return answer


async def output_of(
    *command: str, patience_s: float, said: bytes | None = None, env: Mapping[str, str] | None = None
) -> tuple[int, bytes, bytes]:
    """A command's exit status, output and errors. said: its standard input; env: None is this process's.

    Raises OSError where it cannot be run, TimeoutError where it takes too long: then it is killed.
    """
    child = await asyncio.create_subprocess_exec(
        *command,
        stdin=asyncio.subprocess.DEVNULL if said is None else asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env=env,
    )
    try:
        async with asyncio.timeout(patience_s):
            answer, troubles = await child.communicate(said)
            return await child.wait(), answer, troubles
    finally:
        with contextlib.suppress(ProcessLookupError):
            child.kill()


async def own_child(
    module: str, box: Mapping[str, str], env: Mapping[str, str], stdout: int | None = None
) -> asyncio.subprocess.Process:
    """Start one of the box's own modules beside the page, and await its end. box: as in Settings.

    Raises OSError.
    """
    child = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        *(word for name, path in box.items() for word in (f"--{name}", path)),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=stdout,
        env=env,
    )
    task = asyncio.create_task(child.wait())
    _awaited.add(task)
    task.add_done_callback(_awaited.discard)
    return child
