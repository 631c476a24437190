"""The one place that asks the system for real time, and says what it could not get and what that costs."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import gc
import os
import sys
from collections.abc import Iterator

_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_PR_SET_TIMERSLACK = 29
_SWITCH_INTERVAL_S = 0.0005


def prepare_environment() -> None:
    """Settings that libraries read once, when they are imported: call it before numpy loads."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looking for them takes 5 ms and more
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # otherwise a thread and a database file


def spare_the_collector() -> None:
    """Call it first thing: a start keeps nearly all that it makes, and the collector takes 22 ms in vain.

    enter_realtime or leave_realtime sees to the collector after that. At the end it would take 45 ms once
    more, for memory that goes back to the system as a whole.
    """
    gc.disable()
    atexit.register(gc.freeze)


@contextlib.contextmanager
def uncollected() -> Iterator[None]:
    """While much is read that has no cycles: looking for them took longer than to read."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def give_way(niceness: int) -> None:
    """The dance goes first, also without real-time rights; an installed box says so in the process's unit."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, max(niceness, os.getpriority(os.PRIO_PROCESS, 0)))


def enter_realtime(priority: int) -> tuple[str, ...]:
    """Give the calling thread real-time settings; returns, in words, what could not be had. Never raises.

    Memory is locked as it is touched (ONFAULT): locking whole libraries and thread stacks would cost 100 MB
    and more. Freed heap goes back first: a start that had to read the phrase's text leaves 15 MB. Threads
    started later are ordinary again (RESET_ON_FORK). The collector is frozen and disabled: a collection on a
    large heap took up to 118 ms. The objects that a start leaves (0.7 MB) are frozen too: scanning them would
    delay the first frame by 25 ms.
    """
    share_the_interpreter()
    with contextlib.suppress(OSError, AttributeError):  # the C library of other systems has no such function
        ctypes.CDLL(None).malloc_trim(0)
    missing = (_take_priority(priority), _lock_memory(), _sharpen_timers())
    return tuple(message for message in missing if message)


@contextlib.contextmanager
def borrowed_priority(priority: int | None) -> Iterator[None]:
    """Real-time priority for a measurement, where it can be had (None: leave it); as before after it."""
    if priority is None or _is_realtime() or _take_priority(priority):
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def thread_priority(priority: int) -> str:
    """Real-time priority for only the calling thread; the reason if the system refuses it, else ""."""
    if _is_realtime():
        return ""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        return _reason(error)
    return ""


def share_the_interpreter() -> None:
    """For a thread that must not wait: other threads hand the interpreter over within 0.5 ms, and nothing
    stops all of them to collect what a start has left.
    """
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)


def leave_realtime() -> None:
    """Ordinary again: what comes after the dance may take its time and memory."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).munlockall()
    gc.unfreeze()
    gc.enable()


def _is_realtime() -> bool:
    """Whether the calling thread has real-time priority already: a unit may give it, and allow no other."""
    with contextlib.suppress(OSError, AttributeError):
        return os.sched_getscheduler(0) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    return False


def _take_priority(priority: int) -> str:
    if reason := thread_priority(priority):
        return (
            f"No real-time priority ({reason}). The dance runs, but other programs can hold it up: "
            "on a busy machine one tick in a hundred came 25 to 340 ms late. "
            "Allow it with `ulimit -r 70`, with CPUSchedulingPolicy=fifo in the unit, or with the capability "
            "CAP_SYS_NICE."
        )
    return ""


def _lock_memory() -> str:
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0
        reason = os.strerror(ctypes.get_errno())
    except (OSError, AttributeError) as error:
        failed, reason = True, _reason(error)
    if not failed:
        return ""
    return (
        f"Memory is not locked ({reason}). The dance runs, but a tick can wait for the disk when memory "
        "is short. Allow it with `ulimit -l unlimited` or LimitMEMLOCK=infinity in the unit."
    )


def _sharpen_timers() -> str:
    try:
        failed = ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0
    except (OSError, AttributeError):
        failed = True
    return "Timers stay coarse: ticks start about 0.05 ms late." if failed else ""


def _reason(error: BaseException) -> str:
    return (error.strerror if isinstance(error, OSError) else str(error)) or type(error).__name__
