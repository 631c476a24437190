"""A stranger who floods the sensors' port: noise, copies of what is on the air, forgeries; from 200 ports."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

from tests.sensor.peers import Wearable

RATE_HZ = 10_000

# A process of its own, so that it costs the box nothing but what arrives.
STRANGER = """
import random, socket, sys, time
host, port, rate, total = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
copies = [bytes.fromhex(line) for line in sys.stdin]
rng = random.Random(1)
sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(200)]
def datagram(n):
    copy = rng.choice(copies)
    match n % 3:
        case 0:
            return rng.randbytes(rng.choice((28, 47, 53, 66)))
        case 1:
            return copy
        case _:
            return copy[:8] + rng.randbytes(12) + copy[20:]
begun = time.monotonic()
for n in range(total):
    while n > (time.monotonic() - begun) * rate:
        time.sleep(0.001)
    try:
        sockets[n % 200].sendto(datagram(n), (host, port))
    except OSError:
        pass
"""


def flood(address: tuple[str, int], sensors: Sequence[Wearable], seconds: float) -> subprocess.Popen[str]:
    """10,000 datagrams a second; a third noise, a third the first hello and reading of each of the sensors,
    a third those with another boot nonce, session and sequence, so that only the tag is wrong.
    """
    copies = [data for sensor in sensors for data in (sensor.hello(), sensor.reading())]
    total = str(round(seconds * RATE_HZ))
    command = [sys.executable, "-c", STRANGER, address[0], str(address[1]), str(RATE_HZ), total]
    stranger = subprocess.Popen(command, stdin=subprocess.PIPE, text=True)
    assert stranger.stdin is not None
    stranger.stdin.write("\n".join(copy.hex() for copy in copies))
    stranger.stdin.close()
    return stranger
