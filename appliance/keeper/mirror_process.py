"""A mirror in a separate process: a disk that hangs holds up neither the other mirrors nor a shutdown.

A thread in a write to a dead disk cannot be ended, and its process keeps its locks until the disk answers. A
process can be left behind: the kernel ends it as soon as the disk answers.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
from contextlib import ExitStack, closing, suppress
from pathlib import Path

from appliance.box.checkpoint import CheckpointReader
from appliance.box.pace import Pace
from appliance.box.parent_death import forked
from appliance.keeper.mirror import LOOK_S, RETRY_S, TURN_S, Mirror, Mirrored, mirror_until

_log = logging.getLogger(__name__)

HANGS_S = 5.0  # without a turn for this long, it is reported; a card that erases a block may take seconds
STUCK_S = 60.0  # then it is killed: what hangs in the kernel ends once the disk answers, and is started again
_AGAIN = (
    f"The audience sees nothing of it, and it is tried again within {RETRY_S:g} s. If it goes on, read the "
    "keeper's messages."
)
_LONGEST_TEXT, _LARGEST_MESSAGE = 2000, 1 << 16  # characters; bytes
_TURN = 0  # a message after each turn, in place of the level of a log record


class MirrorProcess:
    """Runs one mirror until its end is requested; starts it again when it dies. Nothing here waits or raises.

    complaint: what cannot be kept, a sentence, else "". fallback: in force meanwhile.
    """

    def __init__(self, mirrored: Mirrored, runtime: Path, end_s: float) -> None:
        """runtime: the folder where the box's processes meet; end_s: as for mirror_until."""
        self.fallback = mirrored.fallback
        self._mirrored, self._runtime, self._end_s = mirrored, runtime, end_s
        self._process = 0  # its number; 0: none runs
        self._channel: socket.socket | None = None
        self._pace = Pace(TURN_S, 1.0 / LOOK_S)
        self._silent_s = 0.0  # without the time in which this process itself was held up
        self._starts_at, self._started_at = 0.0, 0.0
        self._trouble = ""  # it hangs, or has died
        self._mirrors_complaint = ""
        self._is_killed = self._is_ending = False

    @property
    def folder(self) -> Path:
        """Where on the disk it goes."""
        return self._mirrored.folder

    @property
    def complaint(self) -> str:
        return self._trouble or self._mirrors_complaint

    @property
    def has_ended(self) -> bool:
        """Whether its end was requested, and has come."""
        return self._is_ending and not self._process

    def supervise(self, now: float) -> None:
        """Each LOOK_S, monotonic seconds: start it, read its messages, see whether it hangs or has died."""
        self._silent_s += self._pace.step_s(now)
        self._read_messages()
        if self._process:
            self._check_process(now)
        if not self._process and not self._is_ending and now >= self._starts_at:
            self._start(now)

    def request_end(self) -> None:
        """After one last turn, when the show has ended; supervise it until it has_ended."""
        self._is_ending = True
        if self._channel is not None:
            with suppress(OSError):
                self._channel.shutdown(socket.SHUT_WR)

    def abandon(self) -> None:
        """Wait no longer: a process that still runs is killed, and ends once the disk lets it."""
        if self._process:
            self._kill()
            _log.error(
                f"{self._mirrored.name}: the disk does not answer, and what was noted last is not on it. "
                "Check the disk: bunraku doctor."
            )
        self._close_channel()

    def _start(self, now: float) -> None:
        self._started_at, self._starts_at = now, now + RETRY_S
        self._silent_s, self._is_killed = 0.0, False
        try:
            with ExitStack() as failing:
                ours, theirs = map(
                    failing.enter_context, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                )
                self._process = forked(lambda: self._run(theirs))
                theirs.close()
                failing.pop_all()
        except OSError as error:
            self._report_trouble(f"no process can be started for it ({error.strerror}). {_AGAIN}")
            return
        ours.setblocking(False)
        self._channel = ours

    def _read_messages(self) -> None:
        while self._channel is not None:
            try:
                message = self._channel.recv(_LARGEST_MESSAGE)
            except OSError:
                return
            if not message:
                return
            level, text = json.loads(message)
            if level != _TURN:
                _log.log(level, text)
                continue
            self._silent_s, self._mirrors_complaint = 0.0, text
            if self._trouble:
                self._trouble = ""
                _log.info(f"{self._mirrored.name}: it is carried to the disk again.")

    def _check_process(self, now: float) -> None:
        ended, status = os.waitpid(self._process, os.WNOHANG)
        if ended:
            self._read_messages()  # its last ones
            self._process = 0
            self._close_channel()
            if now - self._started_at > RETRY_S:
                self._starts_at = now
            if status:
                self._report_trouble(f"the process that carries it to the disk has died. {_AGAIN}")
        elif self._silent_s > HANGS_S:
            self._report_trouble(
                f"the disk has not answered for {HANGS_S:g} s. The audience sees nothing of it, and all else "
                "is kept meanwhile. Check the disk: bunraku doctor."
            )
            if self._silent_s > STUCK_S and not self._is_killed:
                self._kill()

    def _kill(self) -> None:
        self._is_killed = True
        os.kill(self._process, signal.SIGKILL)

    def _close_channel(self) -> None:
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _report_trouble(self, what: str) -> None:
        trouble = f"{self._mirrored.name}: {what}"
        if trouble != self._trouble:
            _log.warning(trouble)
        self._trouble = trouble

    def _run(self, channel: socket.socket) -> None:
        """In the new process."""
        _detach(channel)
        logging.getLogger().handlers = [_ToParent(channel)]  # the parent's has no thread here
        mirror = Mirror(self._mirrored)
        with closing(CheckpointReader(self._runtime)) as place:
            mirror_until(
                lambda: _is_closed(channel),
                mirror,
                place.goes_on,
                self._end_s,
                lambda: _send(channel, _TURN, mirror.complaint),
            )


class _ToParent(logging.Handler):
    """Records of a mirror, which its parent writes."""

    def __init__(self, channel: socket.socket) -> None:
        super().__init__()
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        _send(self._channel, record.levelno, self.format(record))


def _detach(channel: socket.socket) -> None:
    """End only with the parent, and hold none of its locks, files and sockets."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):  # systemd and a terminal send them to all
        signal.signal(number, signal.SIG_IGN)
    own = channel.fileno()
    os.closerange(3, own)
    os.closerange(own + 1, os.sysconf("SC_OPEN_MAX"))
    channel.setblocking(False)


def _send(channel: socket.socket, level: int, text: str) -> None:
    """To a parent that may be stopped: what finds no room is dropped, and a complaint is sent each turn."""
    with suppress(OSError):
        channel.send(json.dumps([level, text[:_LONGEST_TEXT]]).encode())


def _is_closed(channel: socket.socket) -> bool:
    """Whether the parent has requested the end."""
    try:
        return not channel.recv(1)
    except BlockingIOError:
        return False
    except OSError:
        return True
