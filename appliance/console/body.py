"""What a browser sends with a request, bounded."""

from __future__ import annotations

import json
from typing import Any

from aiohttp import web

LARGEST_REQUEST = 4096  # bytes


async def said(request: web.Request, most: int = LARGEST_REQUEST) -> dict[str, Any]:
    """The body as an object. Raises 400, and 413 above `most` bytes."""
    body = b""
    async for part in request.content.iter_chunked(LARGEST_REQUEST):
        body += part
        if len(body) > most:
            raise web.HTTPRequestEntityTooLarge(max_size=most, actual_size=len(body))
    try:
        values = json.loads(body)
    except (ValueError, RecursionError):
        raise web.HTTPBadRequest(text="This is no JSON.") from None
    if not isinstance(values, dict):
        raise web.HTTPBadRequest(text="This is no JSON object.")
    return values
