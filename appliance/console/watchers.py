"""Browsers that watch: one slot each for the status and for a frame, overwritten, so that the newest wins."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import socket
import time
from collections import Counter

from aiohttp import WSMsgType, web

from appliance.box.door import gives_way

MOST = 64
LONGEST_MESSAGE = 64  # bytes; what a browser says here is whether it wants frames
_SEND_BUFFER = 16384  # bytes in the kernel: frames that wait there are old when a slow browser gets them
_QUIET_S = 10.0  # a browser that answers no ping for this long is gone
_POLLED_S = 1.0  # after a browser asked for a frame, frames are read for this time
_FEW = 8  # browsers that get each frame; with more of them each gets every second one


class _Watcher:
    """One browser. is_known: its device gave the PIN; began: monotonic seconds."""

    def __init__(self, address: str, is_known: bool, text: str, transport: asyncio.Transport | None) -> None:
        self.address, self.is_known, self.began = address, is_known, time.monotonic()
        self.transport = transport
        self.text: str | None = text
        self.frame: bytes | None = None
        self.wants_frames = self.wants_ghost = False
        self.ready = asyncio.Event()
        self.ready.set()

    async def send_on(self, browser: web.WebSocketResponse) -> None:
        """Send the content of the slots, for as long as the browser takes it."""
        with contextlib.suppress(ConnectionError):
            while True:
                await self.ready.wait()
                self.ready.clear()
                text, self.text = self.text, None
                if text is not None:
                    await browser.send_str(text)
                frame, self.frame = self.frame, None
                if frame is not None:
                    await browser.send_bytes(frame)


class Watchers:
    """All of them. A browser that reads nothing only costs its slots."""

    def __init__(self) -> None:
        self._watchers: dict[_Watcher, web.WebSocketResponse] = {}
        self._polled, self._polled_until = (b"", b""), -math.inf

    def __len__(self) -> int:
        return len(self._watchers)

    @property
    def frames_wanted(self) -> bool:
        """Whether any browser shows the dance."""
        return any(one.wants_frames for one in self._watchers) or time.monotonic() < self._polled_until

    @property
    def every(self) -> int:
        """Ticks from one frame to the next."""
        return 1 if sum(one.wants_frames for one in self._watchers) <= _FEW else 2

    def put_text(self, text: str) -> None:
        """For each browser, in place of what it has not taken yet."""
        for one in self._watchers:
            one.text = text
            one.ready.set()

    def put_frame(self, frame: bytes, with_ghost: bytes) -> None:
        """The same for those that show the dance, alone or beside what it starts from."""
        self._polled = frame, with_ghost
        for one in self._watchers:
            if one.wants_frames:
                one.frame = with_ghost if one.wants_ghost else frame
                one.ready.set()

    def polled(self, with_ghost: bool) -> bytes:
        """The newest frame, for a browser that has no WebSocket and asks for each; empty before the first."""
        self._polled_until = time.monotonic() + _POLLED_S
        return self._polled[with_ghost]

    async def serve(
        self, request: web.Request, text: str, address: str, is_known: bool
    ) -> web.StreamResponse:
        """One browser, from its first word to its last. Where all places are taken, a stranger's is given to
        a device that gave the PIN, and to a stranger from an address that has fewer.
        """
        watcher = _Watcher(address, is_known, text, request.transport)
        if len(self._watchers) >= MOST and not self._make_room(watcher):
            raise web.HTTPServiceUnavailable(text="Too many browsers watch already. Close one.")
        browser = web.WebSocketResponse(
            heartbeat=_QUIET_S, max_msg_size=LONGEST_MESSAGE, compress=False, writer_limit=1, timeout=1.0
        )
        await browser.prepare(request)
        _keep_little(request)
        self._watchers[watcher] = browser
        sending = asyncio.create_task(watcher.send_on(browser))
        try:
            async for message in browser:
                wanted = _wish(message.data) if message.type == WSMsgType.TEXT else None
                if wanted is None:
                    await browser.close(code=1008, message=b"not understood")
                    break
                watcher.wants_frames, watcher.wants_ghost = wanted
        finally:
            self._watchers.pop(watcher, None)
            sending.cancel()
        return browser

    def _make_room(self, comes: _Watcher) -> bool:
        """Whether a stranger gave its place up."""
        strangers = [one for one in self._watchers if not one.is_known]
        if not strangers:
            return False
        leaving = gives_way((one, one.address, one.began) for one in strangers)
        crowd = Counter(one.address for one in strangers)
        if not comes.is_known and crowd[leaving.address] <= crowd[comes.address] + 1:
            return False
        del self._watchers[leaving]
        if leaving.transport is not None:
            leaving.transport.abort()
        return True

    async def close(self) -> None:
        """Say goodbye to all: they come back by themselves."""
        for browser in list(self._watchers.values()):
            with contextlib.suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(0.5):
                    await browser.close(code=1001, message=b"the page's process ends")


def _wish(text: str) -> tuple[bool, bool] | None:
    """Whether a browser wants frames, and the ghost; None for anything else that it may have said."""
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(said, dict):
        return None
    frames, ghost = said.get("frames"), said.get("ghost", False)
    return (frames, ghost) if isinstance(frames, bool) and isinstance(ghost, bool) else None


def _keep_little(request: web.Request) -> None:
    transport = request.transport
    if transport is not None:
        transport.set_write_buffer_limits(high=0)
        taken = transport.get_extra_info("socket")
        if taken is not None:
            taken.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
