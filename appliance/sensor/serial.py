"""Readings from a cable: a serial port that may be unplugged and plugged in again at any time."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable

import serial

from appliance.sensor import wire
from appliance.sensor.framing import Deframer

FIRST_RETRY_S = 0.1
LONGEST_RETRY_S = 2.0
WAITING_PACKETS = 128
READ_TIMEOUT_S = 0.1


class SerialIntake:
    """Reads one serial device in a thread of its own: opening a port can take longer than a tick.

    The thread also gives each packet its true time of arrival; it sleeps in the kernel between packets.
    """

    def __init__(self, device: str, baud: int = 115200, clock: Callable[[], float] = time.monotonic) -> None:
        self.device = device
        self.counts: Counter[str] = Counter()
        # For people; None while the port is open.
        self.trouble: str | None = f"{device} is being opened. Sensors on this cable are silent until it is."
        self._baud = baud
        self._clock = clock
        self._packets: deque[tuple[bytes, float]] = deque(maxlen=WAITING_PACKETS)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sensor {device}", daemon=True)
        self._thread.start()

    def receive(self, now: float) -> tuple[wire.Buffer, float] | None:
        """The next packet and its arrival (monotonic seconds, <= now); None when none waits. Never waits."""
        try:
            packet, arrival = self._packets.popleft()
        except IndexError:
            return None
        return packet, min(arrival, now)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        retry_s = FIRST_RETRY_S
        while not self._stop.is_set():
            try:
                with serial.Serial(self.device, self._baud, timeout=READ_TIMEOUT_S, exclusive=True) as port:
                    self.trouble = None
                    retry_s = FIRST_RETRY_S
                    self._read(port)
            except (OSError, ValueError) as error:  # pyserial's SerialException is an OSError
                self.counts["serial_error"] += 1
                self.trouble = (
                    f"{self.device} cannot be read ({error}). Sensors on this cable are silent. "
                    f"Plug it in again, or check device and speed ({self._baud}) in the box file."
                )
            self._stop.wait(retry_s)
            retry_s = min(2 * retry_s, LONGEST_RETRY_S)

    def _read(self, port: serial.Serial) -> None:
        deframer = Deframer(self.counts)
        while not self._stop.is_set():
            received = port.read(max(1, port.in_waiting))
            if received:
                arrival = self._clock()
                for packet in deframer.feed(received):
                    if len(self._packets) == WAITING_PACKETS:
                        self.counts["serial_overrun"] += 1
                    self._packets.append((packet, arrival))
