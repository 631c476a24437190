"""A carrier in a process of its own: a disk that hangs holds up neither the other carriers nor a shutdown.

A thread in a write to a dead disk cannot be ended, and its process holds on to its locks until the disk
answers. A process can be left behind: the kernel ends it as soon as the disk answers.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import signal
import socket
import traceback
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import NamedTuple, NoReturn

from appliance.box.checkpoint import CheckpointReader
from appliance.box.pace import Pace
from appliance.keeper.keeper import LOOK_S, TURN_S, Carrier, keep_on

HANGS_S = 5.0  # without a turn for so long, it is told; a card that erases a block may take seconds
STUCK_S = 60.0  # then it is killed: what hangs in the kernel ends once the disk answers, and is started again
RETRY_S = 10.0
_AGAIN = (
    f"The audience sees nothing of it, and it is tried again within {RETRY_S:g} s. If it goes on, look at "
    "the keeper's messages."
)
_MOST_WORDS, _LARGEST = 2000, 1 << 16  # signs; bytes of a message
_SAID, _TURN = "said", "turn"  # what a message is about
_PR_SET_PDEATHSIG = 1


class Kept(NamedTuple):
    """One thing that the box keeps. thing: what people call it; carrier: makes its carrier, which `say`s."""

    thing: str
    fallback: str
    carrier: Callable[[Callable[[str], None]], Carrier]


class CarrierProcess:
    """Runs one carrier until it is asked to end; started again when it dies. Nothing here waits or raises.

    complaint: what cannot be kept, in words for people, or "". fallback: the name under which that is told.
    """

    def __init__(self, kept: Kept, runtime: Path, end_s: float, say: Callable[[str], None]) -> None:
        """runtime: the folder where the box's processes meet; end_s: as for keep_on."""
        self.fallback = kept.fallback
        self._kept, self._runtime, self._end_s, self._say = kept, runtime, end_s, say
        self._process = 0  # its number; 0: none runs
        self._channel: socket.socket | None = None
        self._pace = Pace(TURN_S, 1.0 / LOOK_S)
        self._silent_s = 0.0  # without the time in which this process itself was held up
        self._starts_at, self._started_at = 0.0, 0.0
        self._trouble = ""  # it hangs, or has died
        self._told = ""  # what the carrier complains of
        self._is_killed = self._is_asked = False

    @property
    def complaint(self) -> str:
        return self._trouble or self._told

    @property
    def has_ended(self) -> bool:
        """Whether it was asked to end, and has."""
        return self._is_asked and not self._process

    def look(self, now: float) -> None:
        """Each LOOK_S, monotonic seconds: start it, hear what it says, see whether it hangs or has died."""
        self._silent_s += self._pace.step_s(now)
        self._hear()
        if self._process:
            self._see_whether_it_lives(now)
        if not self._process and not self._is_asked and now >= self._starts_at:
            self._start(now)

    def ask_to_end(self) -> None:
        """After one last turn, when the show has ended; look on until it has_ended."""
        self._is_asked = True
        if self._channel is not None:
            with suppress(OSError):
                self._channel.shutdown(socket.SHUT_WR)

    def leave(self) -> None:
        """Wait no longer: a process that still runs is killed, and ends once the disk lets it."""
        if self._process:
            self._kill()
            self._say(
                f"{self._kept.thing}: the disk does not answer, and what was noted last is not on it. "
                "Look at the disk: bunraku doctor."
            )
        if self._channel is not None:
            self._channel.close()

    def _start(self, now: float) -> None:
        self._started_at, self._starts_at = now, now + RETRY_S
        self._silent_s, self._is_killed = 0.0, False
        try:
            with ExitStack() as failing:
                ours, theirs = map(
                    failing.enter_context, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                )
                parent = os.getpid()
                self._process = os.fork()
                if not self._process:
                    self._run(theirs, parent)
                theirs.close()
                failing.pop_all()
        except OSError as error:
            self._complain(f"no process can be started for it ({error.strerror}). {_AGAIN}")
            return
        ours.setblocking(False)
        self._channel = ours

    def _hear(self) -> None:
        while self._channel is not None:
            try:
                message = self._channel.recv(_LARGEST)
            except OSError:
                return
            if not message:
                return
            about, words = json.loads(message)
            if about == _SAID:
                self._say(words)
                continue
            self._silent_s, self._told = 0.0, words
            if self._trouble:
                self._trouble = ""
                self._say(f"{self._kept.thing}: it is carried to the disk again.")

    def _see_whether_it_lives(self, now: float) -> None:
        ended, status = os.waitpid(self._process, os.WNOHANG)
        if ended:
            self._hear()  # its last words
            self._process = 0
            if self._channel is not None:
                self._channel.close()
                self._channel = None
            if now - self._started_at > RETRY_S:
                self._starts_at = now
            if status:
                self._complain(f"the process that carries it to the disk has died. {_AGAIN}")
        elif self._silent_s > HANGS_S:
            self._complain(
                f"the disk has not answered for {HANGS_S:g} s. The audience sees nothing of it, and all else "
                "is kept meanwhile. Look at the disk: bunraku doctor."
            )
            if self._silent_s > STUCK_S and not self._is_killed:
                self._kill()

    def _kill(self) -> None:
        self._is_killed = True
        os.kill(self._process, signal.SIGKILL)

    def _complain(self, what: str) -> None:
        trouble = f"{self._kept.thing}: {what}"
        if trouble != self._trouble:
            self._say(trouble)
        self._trouble = trouble

    def _run(self, channel: socket.socket, parent: int) -> NoReturn:
        """In the new process; does not return."""
        status = 1
        try:
            _cut_loose(channel, parent)
            carrier = self._kept.carrier(lambda words: _tell(channel, _SAID, words))
            with closing(CheckpointReader(self._runtime)) as place:
                keep_on(
                    [carrier],
                    lambda: _is_closed(channel),
                    lambda now: _tell(channel, _TURN, carrier.complaint),
                    goes_on=place.goes_on,
                    end_s=self._end_s,
                )
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)


def _cut_loose(channel: socket.socket, parent: int) -> None:
    """End with the parent alone, and hold none of its locks, files and sockets."""
    gc.freeze()  # what the parent has left unused would close descriptors that are others by then
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):  # systemd and a terminal send them to all
        signal.signal(number, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(0)
    own = channel.fileno()
    os.closerange(3, own)
    os.closerange(own + 1, os.sysconf("SC_OPEN_MAX"))
    channel.setblocking(False)


def _tell(channel: socket.socket, about: str, words: str) -> None:
    """To a parent that may be stopped: what finds no room is dropped, and a complaint is told each turn."""
    with suppress(OSError):
        channel.send(json.dumps([about, words[:_MOST_WORDS]]).encode())


def _is_closed(channel: socket.socket) -> bool:
    """Whether the parent has asked for the end."""
    try:
        return not channel.recv(1)
    except BlockingIOError:
        return False
    except OSError:
        return True
