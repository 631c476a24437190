"""A wearable's lanes to the box: its own UDP socket or a serial device; and the log of readings."""

from __future__ import annotations

import socket
import time
from collections import Counter, deque
from pathlib import Path
from types import TracebackType

import serial

from appliance.sensor import wire
from appliance.sensor.framing import END, Deframer, frame
from hw_sim.emulator import Sent

REOPEN_S = 0.5
WRITE_TIMEOUT_S = 0.05
LOG_HEADER = "sensor,boot_nonce,sequence,sent_s,sampled_s,power_on_s,w,x,y,z,note\n"


class UdpSender:
    """Datagrams to `host`:`port` from its own address. Raises OSError when the host is unknown.

    IPv4, as the box and the firmware have it: a name may have an IPv6 address too, before that. Answers are
    checked by tag, not by address, as in the firmware.
    """

    def __init__(self, host: str, port: int) -> None:
        found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)
        self._address = found[0][4]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    @property
    def is_up(self) -> bool:
        return True

    @property
    def descriptor(self) -> int | None:
        return self._socket.fileno()

    def send_packet(self, data: bytes) -> bool:
        try:
            self._socket.sendto(data, self._address)
        except OSError:
            return False
        return True

    def receive_packet(self) -> bytes | None:
        try:
            return self._socket.recv(2 * wire.LARGEST)
        except OSError:
            return None

    def close(self) -> None:
        self._socket.close()


class SerialSender:
    """Framed packets over a serial device, reopened after it was unplugged."""

    def __init__(self, device: str, baud: int = 115200) -> None:
        self._device = device
        self._baud = baud
        self._port: serial.Serial | None = None
        self._next_try = 0.0
        self._deframer = Deframer(Counter())
        self._received: deque[bytes] = deque()

    @property
    def is_up(self) -> bool:
        return self._port is not None

    @property
    def descriptor(self) -> int | None:
        return self._port.fileno() if self._port is not None else None

    def send_packet(self, data: bytes) -> bool:
        if self._port is None:
            return False
        try:
            self._port.write(END + frame(data))
        except (OSError, ValueError):  # pyserial's SerialException is an OSError
            self.close()
            return False
        return True

    def receive_packet(self) -> bytes | None:
        try:
            if self._port is None:
                self._open()
            elif self._port.in_waiting:
                self._received.extend(self._deframer.feed(self._port.read(self._port.in_waiting)))
        except (OSError, ValueError):
            self.close()
        return self._received.popleft() if self._received else None

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._next_try = time.monotonic() + REOPEN_S
        self._port = None

    def _open(self) -> None:
        if time.monotonic() >= self._next_try:
            self._next_try = time.monotonic() + REOPEN_S
            self._port = serial.Serial(self._device, self._baud, timeout=0, write_timeout=WRITE_TIMEOUT_S)
            self._deframer = Deframer(Counter())


class SendLog:
    """A CSV line for each reading as it was sent: stage axes, seconds of time.monotonic()."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8", buffering=1)
        self._file.write(LOG_HEADER)

    def __call__(self, sent: Sent) -> None:
        sample = sent.sample
        w, x, y, z = sample.orientation
        self._file.write(
            f"{sample.sensor},{sample.boot_nonce:08x},{sample.sequence},{sent.sent_at:.7f},"
            f"{sample.sampled_at:.7f},{sample.power_on_at:.7f},"
            f"{w:.6f},{x:.6f},{y:.6f},{z:.6f},{sent.note}\n"
        )

    def __enter__(self) -> SendLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
