"""Hands of browsers: what they hold joints at, on its way to show control, and every joint given back."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

from aiohttp import WSMsgType, web

from appliance.box.record import WholeFile
from appliance.console.desk import Desk, NoAnswerError, Stream
from appliance.console.guard import Guard
from appliance.pose.foreign_file import plain_json
from appliance.show_control.command import LONGEST_NAME

SILENT_S = 0.5  # a browser that holds a joint says so 20 times a second
MOST = 8  # browsers that hold joints
_MOST_JOINTS = 8  # in all of them
_TRIES = 3
_LONGEST_MESSAGE = 512  # bytes
_LOOK_S = 0.1
_LARGEST = 4096
_TURN, _PLACE, _RELEASE = "/mocap/setjointrot", "/mocap/setjointpos", "/mocap/releasejoint"
_FAR_M = 100.0


class _Said(NamedTuple):
    """A browser's message about a joint: a command's address and numbers; without an address it lets go."""

    joint: str
    address: str = ""
    numbers: tuple[float, ...] = ()


class _Hold(NamedTuple):
    """One joint in a browser's hand. heard_at: monotonic seconds."""

    browser: web.WebSocketResponse
    heard_at: float


class BrowserHands:
    """Joints that browsers hold. A joint is given back when its browser lets go, is silent for SILENT_S or is
    gone, and when its device was revoked; after a crash of this process, by the next one.

    folder: of the runtime; there stands which joints are held.
    """

    def __init__(self, guard: Guard, desk: Desk, folder: Path) -> None:
        self._guard, self._desk = guard, desk
        self._held: dict[str, _Hold] = {}
        self._note = WholeFile(folder / "console.browser_hands", _LARGEST)
        self._browsers: set[web.WebSocketResponse] = set()
        self._releasing: set[asyncio.Task[None]] = set()

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/hands", self.serve)]

    async def watch(self) -> None:
        """Give back what a crash left held; then, all the time, what is silent."""
        for joint in self._left():
            self._give_back(joint)
        while True:
            await asyncio.sleep(_LOOK_S)
            now = time.monotonic()
            for joint, hold in list(self._held.items()):
                if now - hold.heard_at > SILENT_S:
                    self._give_back(joint)

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """One browser. It says {"joint": name, "turned": [w, x, y, z]}, local to the parent; in place of that
        "at": [x, y, z], metres in the room; or neither, and lets go.
        """
        if len(self._browsers) >= MOST:
            raise web.HTTPServiceUnavailable(text="Too many browsers hold joints already. Close one.")
        browser = web.WebSocketResponse(heartbeat=5.0, max_msg_size=_LONGEST_MESSAGE, compress=False)
        await browser.prepare(request)
        self._browsers.add(browser)
        try:
            async with self._desk.streaming() as stream:
                answering = asyncio.create_task(_send_refusals(stream, browser))
                try:
                    async for message in browser:
                        said = _said(message.data) if message.type == WSMsgType.TEXT else None
                        if said is None or self._guard.device(request) is None:
                            await browser.close(code=1008, message=b"not understood")
                            break
                        if refusal := self._follow(browser, stream, said):
                            await browser.send_str(json.dumps({"refused": refusal}))
                finally:
                    answering.cancel()
        except NoAnswerError as error:
            await browser.send_str(json.dumps({"refused": str(error)}))
        finally:
            self._browsers.discard(browser)
            for joint, hold in list(self._held.items()):
                if hold.browser is browser:
                    self._give_back(joint)
        return browser

    async def close(self) -> None:
        for joint in list(self._held):
            self._give_back(joint)
        await asyncio.gather(*self._releasing)
        for browser in list(self._browsers):
            with contextlib.suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(0.5):
                    await browser.close(code=1001)

    def _follow(self, browser: web.WebSocketResponse, stream: Stream, said: _Said) -> str:
        """Hold a joint, or let it go; why not, in a sentence."""
        joint = said.joint
        hold = self._held.get(joint)
        is_own = hold is not None and hold.browser is browser
        if not said.address:
            if is_own:
                self._give_back(joint)
            return ""
        if hold is not None and not is_own:
            return f"Another browser holds {joint}. It is free when that one lets go."
        if hold is None and len(self._held) >= _MOST_JOINTS:
            return f"{_MOST_JOINTS} joints are held already. Let one go."
        self._held[joint] = _Hold(browser, time.monotonic())
        if hold is None:
            self._write_note()
        stream.send(said.address, [joint, *said.numbers])
        return ""

    def _give_back(self, joint: str) -> None:
        self._held.pop(joint, None)
        task = asyncio.create_task(self._release(joint))
        self._releasing.add(task)
        task.add_done_callback(self._releasing.discard)

    async def _release(self, joint: str) -> None:
        """Try some times at most, and not for a joint that a browser has taken again meanwhile."""
        for _ in range(_TRIES):
            if joint in self._held:
                return
            with contextlib.suppress(NoAnswerError, ValueError):
                if (await self._desk.send_command(_RELEASE, [joint]))[0]:
                    break
        self._write_note()

    def _left(self) -> list[str]:
        """Joints that a process before this one held when it died."""
        try:
            return [str(joint) for joint in plain_json(self._note.read()[0])][:_MOST_JOINTS]
        except (OSError, ValueError, TypeError, IndexError):
            return []

    def _write_note(self) -> None:
        with contextlib.suppress(OSError):
            self._note.write(json.dumps(sorted(self._held)).encode())


async def _send_refusals(stream: Stream, browser: web.WebSocketResponse) -> None:
    with contextlib.suppress(ConnectionError):
        while True:
            await browser.send_str(json.dumps({"refused": await stream.refusal()}))


def _said(text: str) -> _Said | None:
    """The browser's message; None for anything else."""
    try:
        said: Any = json.loads(text)
        joint, turned, at = said["joint"], said.get("turned"), said.get("at")
    except (ValueError, RecursionError, TypeError, KeyError, AttributeError):
        return None
    if not isinstance(joint, str) or not 0 < len(joint) <= LONGEST_NAME or not joint.isprintable():
        return None
    if turned is None and at is None:
        return _Said(joint)
    if turned is None:
        place = _numbers(at, 3)
        return _Said(joint, _PLACE, place) if place and all(abs(v) <= _FAR_M for v in place) else None
    numbers = _numbers(turned, 4)
    if at is not None or not numbers or not 0.5 < math.hypot(*numbers) < 2.0:
        return None
    return _Said(joint, _TURN, _axis_angle(numbers))


def _numbers(given: Any, count: int) -> tuple[float, ...]:
    """So many numbers; () for anything else."""
    if not isinstance(given, list) or len(given) != count or not all(type(v) in (int, float) for v in given):
        return ()
    try:
        return tuple(map(float, given))
    except OverflowError:
        return ()


def _axis_angle(turned: tuple[float, ...]) -> tuple[float, float, float, float]:
    """x, y, z of the axis and the angle in radians, as show control takes a rotation."""
    w, x, y, z = turned
    sine = math.hypot(x, y, z)
    if sine < 1e-9:
        return 0.0, 1.0, 0.0, 0.0
    return x / sine, y / sine, z / sine, 2.0 * math.atan2(sine, w)
