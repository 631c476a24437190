"""A wearable's console on a real pseudo-terminal, to the letter of the protocol, with faults."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import time
import tty
from dataclasses import dataclass, field
from hashlib import blake2s
from types import TracebackType

from appliance.sensor import wire
from appliance.sensor.framing import frame

HELLO_S = 0.05
ID = "ok bunraku-wearable 1.0.0 wire {wire:08x} imu {imu} board deadbeef"
IMU = "00112233445566778899aabbccddeeff"


@dataclass
class Memory:
    """What `set` changes and `save` keeps."""

    name: str = "none"
    device: str = "none"
    key: bytes = field(default=b"", repr=False)
    network: str = ""
    password: str = field(default="", repr=False)
    port: int = 9750
    fusion: str = "imuplus"
    axes: str = "24 00"
    crystal: str = "no"


@dataclass
class FakeWearable:
    """Text and frames on one line, as docs/wire.md has it; `saved` is what survives power-off.

    Faults: `pulls_at`: the cable comes loose when this command comes; `pulls_after`: when it was carried out,
    before the answer; `refuses`: command -> words; `mute`: nothing is answered; `forgets`: save keeps a wrong
    key; `chatter`: hellos of its own between the lines; `ids_before_imu`: how often it is asked before it has
    found its IMU.
    """

    saved: Memory = field(default_factory=Memory)
    wire_hash: int = wire.WIRE_HASH
    pulls_at: str = ""
    pulls_after: str = ""
    refuses: dict[str, str] = field(default_factory=dict)
    mute: bool = False
    forgets: bool = False
    chatter: bool = True
    ids_before_imu: int = 0
    heard: list[str] = field(default_factory=list)

    def __enter__(self) -> FakeWearable:
        self.draft = Memory(**vars(self.saved))
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(slave)
        self._slave: int | None = slave
        self._ending = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending = True
        self._thread.join()
        if self._slave is not None:
            self._pull()

    def _pull(self) -> None:
        assert self._slave is not None
        os.close(self._slave)
        os.close(self._master)
        self._slave = None

    def _run(self) -> None:
        in_frame, text, packet, next_hello_at = False, b"", b"", 0.0
        hello = frame(bytes(range(1, 48)) + b"\nok no answer\n")
        while not self._ending:
            if self.chatter and time.monotonic() > next_hello_at:
                self._write(b"\0" + hello)
                next_hello_at = time.monotonic() + HELLO_S
            if not select.select([self._master], [], [], 0.01)[0]:
                continue
            for sign in os.read(self._master, 4096):
                byte = bytes([sign])
                if in_frame:
                    in_frame, packet = (byte != b"\0" or not packet), (packet + byte).strip(b"\0")
                elif byte == b"\0":
                    in_frame, text, packet = True, b"", b""
                elif byte in b"\r\n":
                    line, text = text.decode(), b""
                    if line and not self._take(line):
                        self._pull()
                        return
                else:
                    text += byte

    def _take(self, line: str) -> bool:
        """Whether the cable is still in afterwards."""
        self.heard.append(line)
        command = " ".join(line.split()[: 2 if line.startswith("set ") else 1])
        if command == self.pulls_at:
            return False
        answer = self.refuses.get(command) or self._carry_out(line)
        if command == self.pulls_after:
            return False
        if not self.mute:
            self._write(answer.encode() + b"\r\n")
        return True

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # nobody reads: it is dropped, as on USB
            os.write(self._master, data)

    def _carry_out(self, line: str) -> str:
        if len(line) > 128:
            return "error: a line has 128 bytes at most, nothing was done; type help"
        word, _, rest = line.partition(" ")
        if word == "id":
            self.ids_before_imu -= 1
            return ID.format(wire=self.wire_hash, imu="none" if self.ids_before_imu >= 0 else IMU)
        if word == "show":
            one = self.draft
            return (
                f"ok name {one.name} device {one.device} key {'set' if one.key else 'none'} "
                f"password {'set' if one.password else 'none'} port {one.port} fusion {one.fusion} "
                f"crystal {one.crystal} axes {one.axes} network {one.network}"
            )
        if word == "set":
            return self._set(*rest.partition(" ")[::2])
        if word == "save":
            self.saved = Memory(**vars(self.draft))
            if self.forgets:
                self.draft.key = bytes(16)
            return "ok saved"
        if word == "prove" and self.draft.key:
            proof = blake2s(b"prove" + bytes.fromhex(rest), key=self.draft.key, digest_size=8)
            return f"ok {proof.hexdigest()}"
        return f"error: unknown command '{word}'; type help"

    def _set(self, what: str, value: str) -> str:
        if not hasattr(self.draft, what):
            return f"error: unknown setting '{what}'; type help"
        setattr(self.draft, what, bytes.fromhex(value) if what == "key" else value)
        return "ok"
