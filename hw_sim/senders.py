"""The ways out of the emulator: UDP to the box, or a serial device; and the log of what was sent."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from types import TracebackType
from typing import Protocol

import serial

from appliance.sensor.framing import frame
from hw_sim.emulator import Sent

REOPEN_S = 0.5
WRITE_TIMEOUT_S = 0.05
LOG_HEADER = "sensor,boot_nonce,sequence,sent_s,sampled_s,w,x,y,z,note\n"


class Sender(Protocol):
    """Sends one datagram and says whether it could; never raises."""

    def send(self, data: bytes) -> bool: ...

    def close(self) -> None: ...


class UdpSender:
    """Datagrams to `host`:`port`. Raises OSError when the host is unknown."""

    def __init__(self, host: str, port: int) -> None:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._address = address
        self._socket = socket.socket(family, kind, protocol)

    def send(self, data: bytes) -> bool:
        try:
            self._socket.sendto(data, self._address)
        except OSError:
            return False
        return True

    def close(self) -> None:
        self._socket.close()


class SerialSender:
    """Framed packets to a serial device, opened anew when it was unplugged."""

    def __init__(self, device: str, baud: int = 115200) -> None:
        self._device = device
        self._baud = baud
        self._port: serial.Serial | None = None
        self._next_try = 0.0

    def send(self, data: bytes) -> bool:
        try:
            if self._port is None:
                if time.monotonic() < self._next_try:
                    return False
                self._port = serial.Serial(self._device, self._baud, write_timeout=WRITE_TIMEOUT_S)
            self._port.write(frame(data))
        except (OSError, ValueError):  # pyserial's SerialException is an OSError
            self.close()
            self._next_try = time.monotonic() + REOPEN_S
            return False
        return True

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
        self._port = None


class SendLog:
    """A CSV with a line for each datagram as it was really sent; times are seconds of time.monotonic()."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8", buffering=1)
        self._file.write(LOG_HEADER)

    def __call__(self, sent: Sent) -> None:
        sample = sent.sample
        w, x, y, z = sample.orientation
        self._file.write(
            f"{sample.sensor},{sample.boot_nonce:08x},{sample.sequence},{sent.sent_at:.7f},{sample.sampled_at:.7f},"
            f"{w:.6f},{x:.6f},{y:.6f},{z:.6f},{sent.note}\n"
        )

    def __enter__(self) -> SendLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
