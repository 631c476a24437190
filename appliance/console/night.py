"""A picture a minute of the night, for a technician far away: the wall and the state of the box, as SVG."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import struct
import time
from array import array
from html import escape
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.box.durable import private_folder, write_whole
from appliance.box.wall_file import ask_for_wall, wall_picture
from appliance.console.box_view import BoxView
from appliance.console.stage_view import StageView
from appliance.outputs.frame_layout import BROWSER_HEAD, GHOST

FOLDER = "night"  # beside PIN and devices
EVERY_S = 60.0
KEEP_S = 14 * 3600.0  # a night: 840 pictures of 15 to 35 kB
MOST_BYTES = 40_000_000  # all pictures together; beyond it the oldest are removed
_WIDTH, _HEIGHT, _FLOOR, _SCALE = 640, 420, 390.0, 170.0  # pixels; pixels a metre
_LINES = 5


class Night:
    """Draws, keeps and serves the pictures. kept: where the box keeps what it learns; runtime: where the
    projector leaves the wall's picture."""

    def __init__(self, stage: StageView, box: BoxView, state: Path, runtime: Path) -> None:
        self._stage, self._box, self._folder, self._runtime = stage, box, state / FOLDER, runtime

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/night", self._list),
            web.get("/api/night/{at}.svg", self._serve),
            web.get("/api/now.svg", self._now),
            web.get("/api/wall.jpg", self._newest),
        ]

    async def watch(self) -> None:
        """Keep one now and every minute; a disk that does not take it costs a picture."""
        while True:
            await asyncio.sleep(EVERY_S)
            with contextlib.suppress(OSError):
                self.keep(time.time())

    def keep(self, now: float) -> None:
        """One picture, and none older than a night. now: Unix seconds. Raises OSError."""
        private_folder(self._folder)
        write_whole(self._folder / f"{now:.0f}.svg", self.picture(now).encode())
        room = MOST_BYTES
        for at in reversed(self.times()):
            path = self._folder / f"{at}.svg"
            room -= path.stat().st_size
            if room < 0 or not now - KEEP_S <= at <= now + EVERY_S:  # or of a clock that was wrong
                path.unlink(missing_ok=True)

    def times(self) -> list[int]:
        """When pictures were kept: Unix seconds, the newest last."""
        with contextlib.suppress(OSError):
            return sorted(int(path.stem) for path in self._folder.glob("*.svg") if path.stem.isdecimal())
        return []

    def picture(self, now: float) -> str:
        """The wall, or without a projector the figure from the audience; and in words what the page tells."""
        wall = wall_picture(self._runtime, now)
        shown = _wall(wall) if wall else _figure(self._stage.with_ghost, self._stage.facts.get("parents", ()))
        lines = [
            f'<text x="12" y="{24 + 19 * place}">{escape(line)}</text>'
            for place, line in enumerate(_said(self._box.value, now))
        ]
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}">'
            f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#0d0f11"/>'
            f"{shown}"
            f'<g fill="#f3ece0" font-family="sans-serif" font-size="14">{"".join(lines)}</g></svg>'
        )

    async def _list(self, request: web.Request) -> web.Response:
        return web.json_response(self.times())

    async def _serve(self, request: web.Request) -> web.Response:
        at = request.match_info["at"]
        if not at.isdecimal() or len(at) > 12:
            raise web.HTTPNotFound(text="There is no such picture.")
        try:
            return _svg((self._folder / f"{at}.svg").read_bytes())
        except OSError:
            raise web.HTTPNotFound(text="There is no such picture.") from None

    async def _now(self, request: web.Request) -> web.Response:
        return _svg(self.picture(time.time()).encode())

    async def _newest(self, request: web.Request) -> web.Response:
        """The wall; a page that asks again and again has a new picture every two seconds."""
        ask_for_wall(self._runtime)
        picture = wall_picture(self._runtime, time.time())
        if not picture:
            raise web.HTTPNotFound(text="There is no such picture.")
        return web.Response(body=picture, content_type="image/jpeg")


def _svg(body: bytes) -> web.Response:
    return web.Response(body=body, content_type="image/svg+xml", charset="utf-8")


def _said(value: dict[str, Any], now: float) -> list[str]:
    status = value.get("status") or {}
    worn = [one for one in value.get("sensors", ()) if one["is_worn"]]
    heard = sum(one["heard"] for one in worn)
    lines = [
        time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(now)),
        f"{status.get('show', '')}  {status.get('state', value.get('frames', ''))}  {status.get('cue', '')}",
        f"Sensors {heard}/{len(worn)}  {status.get('rate_hz', 0.0):.1f} Hz  late {status.get('late', 0)}",
    ]
    active = [one for one in value.get("fallbacks", ()) if one["active"]]
    return lines + [f"{one['name']} {one['about']}" for one in active[:_LINES]]


def _wall(picture: bytes) -> str:
    below = 24 + 19 * 3  # the first lines of the words are above it
    size = f'y="{below}" width="{_WIDTH}" height="{_HEIGHT - below}"'
    return f'<image {size} href="data:image/jpeg;base64,{base64.b64encode(picture).decode()}"/>'


def _figure(frame: bytes, parents: Any) -> str:
    """The floor, and lines for the bones of each puppet, x to the right and y up; "" before a frame."""
    try:
        _, flags, joints = BROWSER_HEAD.unpack_from(frame)
        numbers = array("f", frame[BROWSER_HEAD.size :])
    except (struct.error, ValueError):
        return ""
    if joints != len(parents) or not joints:
        return ""
    stride = 8 * joints
    puppets = (len(numbers) - (4 * joints if flags & GHOST else 0)) // stride
    places = [
        [tuple(numbers[stride * puppet + 4 * joints + 3 * joint :][:3]) for joint in range(joints)]
        for puppet in range(puppets)
    ]
    middle = sum(one[0][0] for one in places) / max(puppets, 1)
    bones = "".join(
        f'<path d="M{_at(one[joint], middle)}L{_at(one[parent], middle)}"/>'
        for one in places
        for joint, parent in enumerate(parents)
        if parent >= 0
    )
    return (
        f'<path d="M0 {_FLOOR}H{_WIDTH}" stroke="#3d434b"/>'
        f'<g stroke="#eee2ce" stroke-width="9" stroke-linecap="round">{bones}</g>'
    )


def _at(place: tuple[float, ...], middle: float) -> str:
    return f"{_WIDTH / 2 + _SCALE * (place[0] - middle):.1f} {_FLOOR - _SCALE * place[1]:.1f}"
