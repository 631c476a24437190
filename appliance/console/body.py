"""The body of a browser's request, bounded."""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.pose.foreign_file import plain_json

LARGEST_REQUEST = 4096  # bytes
_SENT_WITHIN_S, _FILE_WITHIN_S = 20.0, 900.0
SILENT_S = 30.0  # a sender that sends no byte in this time has left the network
PART = 1 << 20


async def said(request: web.Request, most: int = LARGEST_REQUEST) -> dict[str, Any]:
    """The body as an object. Raises 400, 413 above `most` bytes, and 408 where it does not come."""
    body = b""
    try:
        async with asyncio.timeout(_SENT_WITHIN_S):
            async for part in request.content.iter_chunked(LARGEST_REQUEST):
                body += part
                if len(body) > most:
                    raise web.HTTPRequestEntityTooLarge(max_size=most, actual_size=len(body))
    except TimeoutError:
        raise web.HTTPRequestTimeout(text="The rest of this request did not come.") from None
    try:
        values = plain_json(body)
        json.dumps(values, ensure_ascii=False, allow_nan=False).encode()  # half a surrogate pair is no text
    except (ValueError, RecursionError):
        raise web.HTTPBadRequest(text="This is no JSON.") from None
    if not isinstance(values, dict):
        raise web.HTTPBadRequest(text="This is no JSON object.")
    return values


async def received(request: web.Request, path: Path, largest: int) -> None:
    """Write the body into a file. Raises 503 where not all of it comes, or it is larger; no file is left."""
    size, is_whole = 0, False
    loop = asyncio.get_running_loop()
    until = loop.time() + _FILE_WITHIN_S
    try:
        async with asyncio.timeout(SILENT_S) as patience:
            with new_file(path) as file:
                async for part in request.content.iter_chunked(PART):
                    size += len(part)
                    if size > largest:
                        raise OSError("it is too large")
                    file.write(part)
                    patience.reschedule(min(until, loop.time() + SILENT_S))
        is_whole = True
    except TimeoutError:
        raise web.HTTPServiceUnavailable(text="The file did not arrive whole (nothing more came).") from None
    except OSError as error:
        raise web.HTTPServiceUnavailable(text=f"The file did not arrive whole ({error}).") from None
    finally:
        if not is_whole:
            path.unlink(missing_ok=True)


def new_file(path: Path) -> Any:
    """A file for writing that only this user reads; no link is followed. Raises OSError."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW
    return os.fdopen(os.open(path, flags, 0o600), "wb")
