"""Browsers that open the box's page, watch the dance for a while, and leave; others come after them."""

from __future__ import annotations

import asyncio
import threading

from aiohttp import ClientError, ClientSession, ClientTimeout, WSMsgType

from hw_sim.peers import HOST

VIEWERS = 3
_STAYS_S = 20.0
_PAUSE_S = 1.0
_WITHIN_S = 5.0  # a viewer leaves a page that is silent for this long
_PAGES = ("/", "/page.css", "/status")


class Viewers:
    """Watches in a separate thread. `visits`: pages opened. `frames` and `texts`: received by WebSocket."""

    def __init__(self, port: int) -> None:
        self.visits = self.frames = self.texts = 0
        self._origin = f"http://{HOST}:{port}"
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._watching: list[asyncio.Task[None]] = []

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def close(self) -> None:
        """Leave."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._leave)
            self._thread.join(2.0 * _WITHIN_S)
        else:
            self._loop.close()

    def _run(self) -> None:
        self._loop.run_until_complete(self._all())
        self._loop.close()

    def _leave(self) -> None:
        for one in self._watching:
            one.cancel()

    async def _all(self) -> None:
        self._watching = [asyncio.create_task(self._come_and_go(number)) for number in range(VIEWERS)]
        await asyncio.gather(*self._watching, return_exceptions=True)

    async def _come_and_go(self, number: int) -> None:
        await asyncio.sleep(number * _STAYS_S / VIEWERS)
        while True:
            try:
                async with ClientSession(timeout=ClientTimeout(_WITHIN_S)) as session:
                    await self._visit(session)
            except (ClientError, TimeoutError, OSError):
                pass  # the page was killed: its next one answers
            await asyncio.sleep(_PAUSE_S)

    async def _visit(self, session: ClientSession) -> None:
        for page in _PAGES:
            async with session.get(self._origin + page) as answer:
                await answer.read()
        leaves_at = self._loop.time() + _STAYS_S
        async with session.ws_connect(self._origin + "/watch", headers={"Origin": self._origin}) as browser:
            self.visits += 1
            await browser.send_json({"frames": True})
            while self._loop.time() < leaves_at:
                message = await browser.receive(_WITHIN_S)
                if message.type not in (WSMsgType.BINARY, WSMsgType.TEXT):
                    return
                self.frames += message.type == WSMsgType.BINARY
                self.texts += message.type == WSMsgType.TEXT
