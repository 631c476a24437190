"""A technician's bench: a wearable with the compiled firmware, on a cable and in reach of Wi-Fi."""

from __future__ import annotations

import contextlib
import os
import pty
import socket
import threading
import time
import tty

from hw_sim.firmware_library import CompiledWearable, State

NETWORK, PASSWORD = "stage net", "row H, seat 7"
HOST = "127.0.0.1"
TURN_S = 0.002
_BOX = (0x7F000001, 9750)  # where the box is, as the simulated radio sees it


class Bench:
    """A context. A thread keeps virtual time in step with real time.

    `pulls_at`: the cable comes loose as soon as the wearable has received this; `plug_in` puts it back.
    """

    def __init__(self, box_port: int | None = None) -> None:
        self.pulls_at = b""
        self.state = State.NOT_PROVISIONED
        self._box_port = box_port
        self._master = self._slave = -1
        self._turning = threading.Lock()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._wearable = CompiledWearable(seed=time.time_ns())
        self._wearable.set_network(NETWORK, PASSWORD)
        self._wearable.set_access_point(True, 0)
        self._wearable.power(True)
        self.plug_in()

    def __enter__(self) -> Bench:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        self.pull_out()
        self._wearable.close()

    def plug_in(self) -> None:
        with self._turning:
            self._master, self._slave = pty.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.device = os.ttyname(self._slave)
            self._wearable.connect_cable(True)

    def pull_out(self) -> None:
        with self._turning:
            if self._master >= 0:
                os.close(self._slave)
                os.close(self._master)
                self._master = -1
                self._wearable.connect_cable(False)

    def flash(self) -> bytes:
        with self._turning:
            return self._wearable.flash_image()

    def _live(self) -> None:
        began, waiting, received_last = time.monotonic(), b"", b""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
            radio.setblocking(False)
            while not self._is_over.wait(TURN_S):
                with self._turning:
                    with contextlib.suppress(BlockingIOError):
                        received = os.read(self._master, 4096) if self._master >= 0 else b""
                        waiting += received
                        received_last = received_last[-200:] + received if self.pulls_at else b""
                    waiting = waiting[self._wearable.put_serial(waiting) :]
                    self._wearable.step_until(round((time.monotonic() - began) * 1e6))
                    sent = self._wearable.take_serial()
                    self._use_radio(radio)
                    self.state = State(self._wearable.status.state)
                    is_pulled = bool(self.pulls_at) and self.pulls_at in received_last
                    with contextlib.suppress(BlockingIOError):
                        if sent and self._master >= 0 and not is_pulled:  # what it sends now is lost
                            os.write(self._master, sent)
                if is_pulled:
                    self.pull_out()
                    self.pulls_at, waiting, received_last = b"", b"", b""

    def _use_radio(self, radio: socket.socket) -> None:
        for sent in self._wearable.take_datagrams():
            if self._box_port is not None:
                radio.sendto(sent.data, (HOST, self._box_port))
        with contextlib.suppress(BlockingIOError):
            while self._box_port is not None:
                self._wearable.put_datagram(_BOX, radio.recv(512))
