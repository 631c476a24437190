"""The wearable's text console on its USB cable, from the box's side: one line each way.

Packets on the same cable (each between zero bytes) are skipped.
"""

from __future__ import annotations

import errno
import re
import secrets
import termios
import time
from collections import deque
from dataclasses import dataclass
from hashlib import blake2s
from hmac import compare_digest

import serial

from appliance.pose.correctable_error import CorrectableError
from appliance.sensor.provisioning.serial_ports import found_ports, ports_sentence
from appliance.sensor.wire import TAG_BYTES

BAUD = 115200  # USB: any speed is the same, but 1200 would start the bootloader
PATIENCE_S = 15.0  # joining Wi-Fi keeps the wearable from answering for up to 10 s
LONGEST_LINE = 128
# Resets the wearable's reader to text: ends an open frame, then sends an empty one.
_TO_TEXT = b"\x00\x00\x01\x00\n"
_ASK_AGAIN_S = 3.0
_IMU_STARTS_S = 2.0  # a BNO055 takes 0.65 s after power-on, and some tries
_ASK_FOR_IMU_S = 0.2
_QUIET_S = 0.15
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f]")  # control characters never reach the terminal
_LONGEST_ANSWER = 320
_IDENTITY = re.compile(
    r"ok bunraku-wearable (?P<firmware>\S+) wire (?P<wire>[0-9a-f]{8}) "
    r"imu (?P<imu>none|[0-9a-f]{32}) board (?P<board>\S+)"
)


class ConsoleError(CorrectableError):
    """The wearable's console failed: what happened and what to do."""


class UnpluggedError(ConsoleError):
    """The cable is gone, or the wearable stopped answering."""


class RefusedError(ConsoleError):
    """The wearable refused the command."""


@dataclass(frozen=True)
class Identity:
    """A wearable's answer to `id`."""

    firmware: str
    wire_hash: int
    imu_id: str  # hexadecimal; empty: it finds no IMU
    board: str


class WearableConsole:
    """A wearable on a serial port. A context; raises ConsoleError with a message for people."""

    def __init__(self, device: str, patience_s: float = PATIENCE_S) -> None:
        self.device = device
        self._patience_s = patience_s
        self._text = TextOnCable()
        self._lines: deque[str] = deque()
        try:
            self._port = serial.Serial(device, BAUD, timeout=0.05, write_timeout=patience_s, exclusive=True)
        # SerialException is a subclass of OSError, termios.error is not: open() lets it through.
        except (OSError, ValueError, termios.error) as error:
            raise ConsoleError(_cannot_open(device, error)) from None

    def __enter__(self) -> WearableConsole:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def identify(self) -> Identity:
        """Find the wearable on this port and read its identity, after its IMU has started."""
        until = time.monotonic() + self._patience_s
        while (identity := self._identity(until)) is None:
            if time.monotonic() >= until:
                raise ConsoleError(
                    f"Nothing on {self.device} answers as a bunraku wearable. Nothing was changed. "
                    "Is it the right port, and is the firmware on the board (docs/firmware.md)? "
                    "Press its reset button once and try again."
                )
        until = time.monotonic() + _IMU_STARTS_S
        while not identity.imu_id and time.monotonic() < until:
            time.sleep(_ASK_FOR_IMU_S)
            identity = self._identity(until) or identity
        return identity

    def ask(self, command: str, secret: str = "") -> str:
        """Send a command. Returns what follows `ok` in the answer. Raises RefusedError, UnpluggedError.

        `secret` follows the command and is left out of errors.
        """
        line = f"{command} {secret}" if secret else command
        if len(line.encode()) > LONGEST_LINE or any(ord(sign) < 32 for sign in line):
            raise RefusedError(
                f"The wearable's console takes no such line: '{command}' is too long or has odd characters."
            )
        self._write(line.encode() + b"\n")
        until = time.monotonic() + self._patience_s
        while (answer := self._line(until)) is not None:
            if answer == "ok" or answer.startswith("ok "):
                return answer[3:]
            if answer.startswith("error: "):
                message = answer.removeprefix("error: ")
                if secret and secret in message:
                    message = "it repeated what is secret, as no bunraku wearable does; is this one?"
                raise RefusedError(f"The wearable refused '{command}': {message}.")
        raise UnpluggedError(f"The wearable on {self.device} stopped answering (asked: '{command}').")

    def proves(self, key: bytes) -> bool:
        """Whether the wearable has this key, by a challenge that does not reveal it."""
        nonce = secrets.token_bytes(8)
        answer = self.ask(f"prove {nonce.hex()}")
        return compare_digest(answer, blake2s(b"prove" + nonce, key=key, digest_size=TAG_BYTES).hexdigest())

    def _line(self, until: float) -> str | None:
        """The next line of text; None when none came in time."""
        while not self._lines:
            if time.monotonic() >= until:
                return None
            self._lines += self._text.feed(self._read())
        return self._lines.popleft()

    def _identity(self, until: float) -> Identity | None:
        """Its identity; None without an answer soon."""
        self._write(_TO_TEXT + b"id\n")
        until = min(time.monotonic() + _ASK_AGAIN_S, until)
        while (line := self._line(until)) is not None:
            found = _IDENTITY.fullmatch(line)
            if found:
                self._settle()
                imu_id = "" if found["imu"] == "none" else found["imu"]
                return Identity(found["firmware"], int(found["wire"], 16), imu_id, found["board"])
        return None

    def _settle(self) -> None:
        """Skip answers to repeated questions."""
        until = time.monotonic() + self._patience_s
        while time.monotonic() < until and self._line(time.monotonic() + _QUIET_S) is not None:
            pass

    def _read(self) -> bytes:
        try:
            return bytes(self._port.read(max(1, self._port.in_waiting)))
        except OSError:
            raise UnpluggedError(
                f"The cable to {self.device} came loose, or the wearable lost its power."
            ) from None

    def _write(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except OSError:
            raise UnpluggedError(
                f"The cable to {self.device} came loose, or the wearable lost its power."
            ) from None


class TextOnCable:
    """Finds the console's lines among packets, in a stream that begins anywhere.

    A packet is enclosed in zero bytes. If its content begins like an answer it is text: a packet begins with
    the distance to its first zero, which is less than any letter's code.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._is_text: bool | None = True  # the stream may begin in the middle of a line

    def feed(self, received: bytes) -> list[str]:
        """The lines completed by `received`."""
        lines: list[bytes] = []
        for number, part in enumerate(received.split(b"\x00")):
            if number:
                self._rest, self._is_text = b"", None
            self._rest += part
            begin = self._rest.lstrip(b"\r\n")[:2]
            if self._is_text is None and len(begin) == 2:
                self._is_text = begin in (b"ok", b"er")
            if self._is_text:
                *complete, self._rest = self._rest.split(b"\n")
                lines += complete
            self._rest = self._rest[-_LONGEST_ANSWER:]
        texts = (line.strip(b"\r").decode("utf-8", "replace") for line in lines)
        return [text for text in texts if text and not _CONTROL.search(text)]


def _cannot_open(device: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY, errno.EWOULDBLOCK):
        return (
            f"{device} is in use by another program. Stop the running bunraku, or take this cable out of "
            "`sensors: serial:` in its box file until the wearable is provisioned."
        )
    if number == errno.EACCES:
        return (
            f"{device} may not be opened by this user. Run: sudo usermod -aG dialout $USER, log in again, "
            "and try again."
        )
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"There is no serial port {device}. {ports_sentence(found_ports())}"
    return f"{device} cannot be opened as a serial port. {ports_sentence(found_ports())}"
