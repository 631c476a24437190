"""The body of a browser's request, bounded."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from aiohttp import web

from appliance.pose.foreign_file import plain_json

LARGEST_REQUEST = 4096  # bytes
_SENT_WITHIN_S = 20.0


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
