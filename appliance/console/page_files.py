"""The page's own files, read once and served from memory."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

from aiohttp import web

FOLDER = Path(__file__).with_name("page")
_KINDS = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".webmanifest": "application/manifest+json",
}


class _File(NamedTuple):
    content: bytes
    kind: str
    tag: str


def read_files(folder: Path = FOLDER) -> dict[str, _File]:
    """By the path at which browsers ask for them."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in _KINDS:
            content = path.read_bytes()
            tag = f'"{hashlib.sha256(content).hexdigest()[:16]}"'
            found[f"/{path.relative_to(folder).as_posix()}"] = _File(content, _KINDS[path.suffix], tag)
    return found | {"/": found["/index.html"], "/phone": found["/phone.html"]}


def languages(folder: Path = FOLDER) -> list[str]:
    """Those that have a table of words."""
    return sorted(path.stem for path in (folder / "words").glob("*.json"))


class PageFiles:
    """Serves them; a browser that has the newest gets 304."""

    def __init__(self) -> None:
        self._files = read_files()

    async def serve(self, request: web.Request) -> web.Response:
        """Raises 404 for a path without a file: no path leads anywhere else."""
        file = self._files.get(request.path)
        if file is None:
            raise web.HTTPNotFound(text="There is nothing at this address.")
        headers = {"Cache-Control": "no-cache", "ETag": file.tag}
        if request.headers.get("If-None-Match") == file.tag:
            return web.Response(status=304, headers=headers)
        return web.Response(body=file.content, content_type=file.kind, charset="utf-8", headers=headers)
