"""A sensor on a cable: a serial port that may be unplugged and plugged in again at any time."""

from __future__ import annotations

import select
import socket
import termios
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress

import serial

from appliance.sensor import wire
from appliance.sensor.framing import END, Deframer, frame
from appliance.sensor.transports.transport import LONGEST_STOP_S, Origin

FIRST_RETRY_S = 0.1
LONGEST_RETRY_S = 2.0
WAITING_PACKETS = 128
UNSENT_PACKETS = 16
WRITE_TIMEOUT_S = 0.1
CLOSE_S = 1.0  # a driver may never return from opening, configuring or closing a dead device


class SerialIntake:
    """Reads and writes one serial device in a separate thread: opening a port can take longer than a tick.

    The thread sleeps in the kernel between packets, and so notes their true arrivals.
    """

    def __init__(self, device: str, baud: int = 115200, clock: Callable[[], float] = time.monotonic) -> None:
        self.device = self.name = device
        self.counts: Counter[str] = Counter()
        # A message; None while the port is open.
        self.trouble: str | None = f"{device} is being opened. Sensors on this cable are silent until it is."
        self._origin = (device,)
        self._baud = baud
        self._clock = clock
        self._packets: deque[tuple[bytes, float]] = deque(maxlen=WAITING_PACKETS)
        self._unsent: deque[bytes] = deque(maxlen=UNSENT_PACKETS)
        self._waker, self._woken = socket.socketpair()
        self._waker.setblocking(False)
        self._stop, self._received = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sensor {device}", daemon=True)
        self._thread.start()

    def receive_packets(self, now: float) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        """Waiting packets and their arrivals (monotonic seconds)."""
        for _ in range(len(self._packets)):
            packet, arrival = self._packets.popleft()
            yield packet, arrival if arrival < now + LONGEST_STOP_S else now, self._origin

    def await_packet(self, origin: Origin, seconds: float) -> None:
        """Wait for the thread to receive a packet."""
        if not self._packets:
            self._received.wait(seconds)
        self._received.clear()

    def send_packet(self, packet: bytes, origin: Origin) -> None:
        """Hand one packet to the thread. Without a cable, or with a full queue, it is dropped and counted."""
        if self.trouble is not None or len(self._unsent) == UNSENT_PACKETS:
            self.counts["send_error"] += 1
            return
        self._unsent.append(packet)
        self._wake()

    def reserve_sockets(self, origins: Collection[Origin]) -> None:
        """Nothing to do: a cable carries no other senders."""

    def describe(self, origin: Origin) -> str:
        return str(origin[0])

    def close(self) -> None:
        """End the thread; after CLOSE_S it is left to a driver that does not return."""
        self._stop.set()
        self._wake()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            return
        self._waker.close()
        self._woken.close()

    def _run(self) -> None:
        retry_s = FIRST_RETRY_S
        while not self._stop.is_set():
            try:
                with serial.Serial(
                    self.device, self._baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
                ) as port:
                    self._unsent.clear()
                    self.trouble = None
                    retry_s = FIRST_RETRY_S
                    self._serve_port(port)
            # SerialException is a subclass of OSError, termios.error is not: open() lets it through.
            except (OSError, ValueError, termios.error) as error:
                self.counts["serial_error"] += 1
                self.trouble = (
                    f"{self.device} cannot be read ({error}). Sensors on this cable are silent. "
                    f"Plug it in again, or check device and speed ({self._baud}) in the box file."
                )
            self._stop.wait(retry_s)
            retry_s = min(2 * retry_s, LONGEST_RETRY_S)

    def _serve_port(self, port: serial.Serial) -> None:
        deframer = Deframer(self.counts)
        while not self._stop.is_set():
            ready, _, _ = select.select([port.fileno(), self._woken.fileno()], [], [])
            if self._woken.fileno() in ready:
                self._woken.recv(UNSENT_PACKETS)
            if port.fileno() in ready:
                received = port.read(max(1, port.in_waiting))
                arrival = self._clock()
                for packet in deframer.feed(received):
                    if len(self._packets) == WAITING_PACKETS:
                        self.counts["serial_overrun"] += 1
                    self._packets.append((packet, arrival))
                    self._received.set()
            while self._unsent:
                self._write(port, self._unsent.popleft())

    def _wake(self) -> None:
        with suppress(OSError):  # full: the thread is about to wake anyway
            self._waker.send(b"!")

    def _write(self, port: serial.Serial, packet: bytes) -> None:
        """One frame between two zero bytes: the first ends any earlier fragment."""
        try:
            port.write(END + frame(packet))
        except serial.SerialTimeoutException:
            self.counts["send_error"] += 1
            _, takes_more, _ = select.select([], [port.fileno()], [], 0.0)
            if not takes_more:  # the other end does not read: what waits is stale
                self.counts["send_error"] += len(self._unsent)
                self._unsent.clear()
