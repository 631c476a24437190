"""The page as a desk of show control: commands by OSC, without waiting for each other."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Any

from appliance.show_control.command import REPLY, STREAMS, reply_to
from appliance.show_control.packet import datagram, messages_in, readable

PATIENCE_S = 2.0  # show control answers within 0.6 s, and later while it starts
_STREAM_S = 0.25  # only the refusal of a stream's command is answered
_MOST_WAITING = 512
_AT_ONCE = 32
NO_COMMANDS = "This box takes no commands: its box file says `control: null`."
SILENT = "Show control does not answer. What is in force stays in force; try again."

Answer = tuple[str, list[Any]]


class NoAnswerError(Exception):
    """Show control does not answer, or there is none; the message is for the user."""


class Desk:
    """Show control at an address; None: this box has none. Each command has its socket."""

    def __init__(self, control: tuple[str, int] | None) -> None:
        self._control = control
        self._free = asyncio.Semaphore(_AT_ONCE)

    @property
    def has_control(self) -> bool:
        """Whether this box takes commands."""
        return self._control is not None

    async def send_command(self, address: str, arguments: Sequence[str | int | float]) -> tuple[bool, str]:
        """Whether show control carried it out, and its sentence. Raises NoAnswerError, ValueError."""
        reply = reply_to(address)
        is_stream = address.startswith(STREAMS)
        patience_s = _STREAM_S if is_stream else PATIENCE_S
        try:
            async with self._asking(datagram((address, *arguments)), patience_s) as replies:
                while True:
                    about, values = await replies()
                    if about == reply and len(values) == 3 and values[0] == address:
                        return bool(values[1]), readable(str(values[2]))
        except NoAnswerError:
            if not is_stream or self._control is None:
                raise
        return True, ""

    @contextlib.asynccontextmanager
    async def streaming(self) -> AsyncIterator[Stream]:
        """A socket for a stream of commands that nothing waits for. Raises NoAnswerError."""
        if self._control is None:
            raise NoAnswerError(NO_COMMANDS)
        try:
            transport, replies = await asyncio.get_running_loop().create_datagram_endpoint(
                _Replies, remote_addr=self._control
            )
        except OSError:
            raise NoAnswerError(SILENT) from None
        try:
            yield Stream(transport, replies.waiting)
        finally:
            transport.close()

    @contextlib.asynccontextmanager
    async def _asking(self, question: bytes, patience_s: float) -> AsyncIterator[Callable[[], Any]]:
        """Send a datagram; inside, awaiting what is given returns the next message that comes back."""
        if self._control is None:
            raise NoAnswerError(NO_COMMANDS)
        silent = NoAnswerError(SILENT)
        async with self._free:
            try:
                transport, replies = await asyncio.get_running_loop().create_datagram_endpoint(
                    _Replies, remote_addr=self._control
                )
            except OSError:
                raise silent from None
            try:
                async with asyncio.timeout(patience_s):
                    transport.sendto(question)
                    yield replies.waiting.get
            except TimeoutError:
                raise silent from None
            finally:
                transport.close()


class Stream:
    """Commands that go out one after the other; only refusals come back."""

    def __init__(self, transport: asyncio.DatagramTransport, waiting: asyncio.Queue[Answer]) -> None:
        self._transport, self._waiting = transport, waiting

    def send(self, address: str, arguments: Sequence[str | int | float]) -> None:
        """One command; what the socket does not take at once is dropped."""
        self._transport.sendto(datagram((address, *arguments)))

    async def refusal(self) -> str:
        """The next sentence that says why a command was not carried out."""
        while True:
            address, values = await self._waiting.get()
            if address == REPLY and len(values) == 3 and not values[1]:
                return readable(str(values[2]))


class _Replies(asyncio.DatagramProtocol):
    """Messages as they come; what is no OSC is left out."""

    def __init__(self) -> None:
        self.waiting: asyncio.Queue[Answer] = asyncio.Queue(_MOST_WAITING)

    def datagram_received(self, received: bytes, sender: Any) -> None:
        with contextlib.suppress(ValueError, asyncio.QueueFull):
            for message in messages_in(received):
                self.waiting.put_nowait(message)
