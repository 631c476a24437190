"""What a process of its own answers: for questions that would load too much into the page's process."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys

from aiohttp import web

LARGEST = 8 << 20  # bytes of an answer


async def answer_of(*arguments: str, patience_s: float) -> bytes:
    """The output of `bunraku` with these arguments, LARGEST bytes at most.

    Raises 404 with its own sentence where it refuses, 503 where it takes too long or says too much.
    """
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "appliance.cli", *arguments),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    try:
        async with asyncio.timeout(patience_s):
            said, troubles = await child.communicate()
    except TimeoutError:
        raise web.HTTPServiceUnavailable(text="Reading this took too long. Try again in a moment.") from None
    finally:
        with contextlib.suppress(ProcessLookupError):
            child.kill()
    if child.returncode:
        words = troubles.decode(errors="replace").strip().rpartition("\n")[2]
        raise web.HTTPNotFound(text=words.removeprefix("bunraku: ") or "This cannot be read.")
    if len(said) > LARGEST:
        raise web.HTTPServiceUnavailable(text="That is too much at once.")
    return said
