"""An attacker on the venue's network: receives everything, has no key, and tries everything."""

from __future__ import annotations

import random
import socket
from collections import Counter

from appliance.sensor import wire

HOST = "127.0.0.1"
MOST_REMEMBERED = 4000


class Attacker:
    """Replays, reflects, forges, truncates and damages packets to box and wearables, from its own socket."""

    def __init__(self, box: tuple[str, int], wearables: list[tuple[str, int]], seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self._box = box
        self._wearables = wearables
        self._chance = random.Random(f"attacker {seed}")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((HOST, 0))
        self._socket.setblocking(False)
        self._heard: list[bytes] = []  # from wearables
        self._answers: list[bytes] = []  # from the box
        self._tagger = wire.Tagger(self._chance.randbytes(wire.KEY_BYTES))

    def overhear(self, data: bytes) -> None:
        """Record a packet on the air; the newest are kept, and the oldest of the evening."""
        is_answer = wire.LAYOUTS[data[3]].direction == "box to sensor"
        self._remember(self._answers if is_answer else self._heard, data)

    def act(self, times: int) -> None:
        """Attack this many times. The box's answers to replayed hellos are used too."""
        while (answer := self._receive()) is not None:
            self._remember(self._answers, answer)
        for _ in range(times):
            if not self._heard:
                return
            attack = self._chance.choice(
                (self._replay, self._reflect, self._forge, self._cut, self._damage, self._wrong_key)
            )
            attack()

    def close(self) -> None:
        self._socket.close()

    def _replay(self) -> None:
        self._send("replay", self._box, self._chance.choice(self._heard))
        if self._answers:
            self._send("replay", self._chance.choice(self._wearables), self._chance.choice(self._answers))

    def _reflect(self) -> None:
        self._send("reflect", self._chance.choice(self._wearables), self._heard[-1])
        if self._answers:
            self._send("reflect", self._box, self._answers[-1])

    def _forge(self) -> None:
        """The newest reading again, with a later sequence and another orientation, under its old tag."""
        data = bytearray(self._heard[-1])
        sequence = int.from_bytes(data[16:20], "little") + self._chance.randrange(1, 50)
        data[16:20] = (sequence & 0xFFFFFFFF).to_bytes(4, "little")
        data[24:32] = bytes((0, 0, 0, 0, 0, 0, 0, 0x40))
        self._send("forge", self._box, bytes(data))

    def _cut(self) -> None:
        data = self._chance.choice(self._heard)
        self._send("cut", self._box, data[: self._chance.randrange(len(data))])

    def _damage(self) -> None:
        data = bytearray(self._chance.choice(self._heard[-50:]))
        data[self._chance.randrange(len(data))] ^= 1 << self._chance.randrange(8)
        self._send("damage", self._box, bytes(data))

    def _wrong_key(self) -> None:
        """Valid packets of every kind, for the present session, signed with the attacker's own key."""
        _, _, _, device, boot, session, sequence = wire.HEAD.unpack_from(self._heard[-1])
        head = device, boot, session, sequence + 1
        turned = (0.0, 0.0, 0.0, 1.0)
        reading = wire.Reading(*head, 5_000_000, turned, 255, 99, 0, taps=1, recoveries=1, flags=0)
        self._send("wrong key", self._box, wire.pack(reading, self._tagger))
        for packet in (
            wire.Assignment(*head, hello_sequence=sequence, hand=0, rate_hz=100, led=4),
            wire.Heartbeat(*head, echo_sequence=sequence, echo_held_us=0, led=4),
            wire.Call(*head),
            wire.Restore(*head, bytes(16), bytes(22)),
        ):
            for wearable in self._wearables:
                self._send("wrong key", wearable, wire.pack(packet, self._tagger))

    def _remember(self, heard: list[bytes], data: bytes) -> None:
        if len(heard) >= MOST_REMEMBERED:
            del heard[MOST_REMEMBERED // 2]
        heard.append(data)

    def _receive(self) -> bytes | None:
        try:
            return self._socket.recv(512)
        except OSError:
            return None

    def _send(self, attack: str, to: tuple[str, int], data: bytes) -> None:
        self.counts[attack] += 1
        self._socket.sendto(data, to)
