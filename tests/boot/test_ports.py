"""Nothing listens beyond what the box file says, and nothing else gets in."""

from __future__ import annotations

import socket
import struct
import subprocess
import time

import pytest

from tests.boot.box import Box
from tests.boot.hall import BOX, CONTROL, HALL, SENSORS
from tests.system.namespace import Namespace

EPHEMERAL = 32768  # from here on the kernel gives ports to those who only send
PAGE = 8080  # of a box whose own file says nothing about it: appliance_box.yaml
MDNS, _GROUP, _ANSWERS_WITHIN_S = 5353, ("224.0.0.251", 5353), 0.3
_A, _PTR = 1, 12  # kinds of a question: an address; a list of services
_PYTHON = "/opt/bunraku/current/bin/python"
_CARD = """
from appliance.cli.console import card_lines
from appliance.release.choice import CHOSEN, RUN, box_of
from appliance.show.box import load_box
print(*card_lines(load_box(box_of(None, RUN / CHOSEN))), sep="\\n")
"""
ROGUE, LISTENS_S = 7777, 1.5
_LISTEN = f"""
import socket
rogue = socket.socket(type=socket.SOCK_DGRAM)
rogue.bind(("", {ROGUE}))
rogue.settimeout({LISTENS_S})
rogue.recv(9)
"""

pytestmark = pytest.mark.boot


def test_ports_that_listen_are_those_of_the_box_file(dancing: Box) -> None:
    dancing.await_unit("bunraku-control")
    dancing.await_unit("bunraku-console")
    opened = set()
    for kind in ("udp", "tcp"):
        for line in dancing.machine.run(
            "ss", "--no-header", "--listening", "--numeric", f"--{kind}"
        ).splitlines():
            host, _, port = line.split()[3].rpartition(":")
            if not host.startswith(("127.", "[::1]")) and int(port) < EPHEMERAL:
                opened.add((kind, int(port)))
    wanted = {("udp", SENSORS), ("udp", CONTROL), ("tcp", PAGE), ("udp", MDNS)}
    assert opened == wanted, dancing.machine.run("ss", "-lunptp")


def test_the_firewall_lets_in_what_the_box_file_opens_and_nothing_else(dancing: Box) -> None:
    machine = dancing.machine
    dancing.await_unit("bunraku-firewall")
    dancing.await_unit("bunraku-control")
    assert dancing.hall.ask("/ping"), "a listed console is shut out"
    assert _heard(dancing, inside=True), "this test cannot tell what gets in"
    assert not _heard(dancing, inside=False), machine.run("nft", "list", "ruleset")


def test_it_is_found_by_its_name_and_in_a_list_of_boxes(dancing: Box) -> None:
    for unit in ("firewall", "announce", "console"):
        dancing.await_unit(f"bunraku-{unit}")
    of_hall = dancing.hall.network
    find = dancing.machine.await_that
    assert find(lambda: socket.inet_aton(BOX) in _answer(of_hall, "bunraku.local", _A), "no address came")
    reported = find(lambda: _answer(of_hall, "_bunraku._tcp.local", _PTR), "no box is listed")
    assert (
        b"Bunraku on bunraku" in reported
        and b"scheme=http" in reported
        and struct.pack(">H", PAGE) in reported
    )
    assert not _answer(of_hall, "another.local", _A), "this test cannot tell who is asked"
    assert "or http://bunraku.local:8080" in dancing.machine.run(
        *("setpriv", "--reuid=bunraku", "--regid=bunraku", "--clear-groups"), _PYTHON, "-c", _CARD
    )


def _answer(network: Namespace, name: str, kind: int) -> bytes:
    """What comes to a question by mDNS (RFC 6762, answered to its sender alone); empty: nothing."""
    labels = b"".join(bytes((len(one),)) + one.encode() for one in name.split("."))
    with network.entered():
        asking = socket.socket(type=socket.SOCK_DGRAM)
    with asking:
        asking.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(HALL))
        asking.settimeout(_ANSWERS_WITHIN_S)
        asking.sendto(
            struct.pack(">6H", 7, 0, 1, 0, 0, 0) + labels + b"\0" + struct.pack(">HH", kind, 1), _GROUP
        )
        try:
            return asking.recv(9000)
        except TimeoutError:
            return b""


def _heard(box: Box, inside: bool) -> bool:
    """Whether a program that listens on a port of its own hears a sender inside the box, or outside."""
    entered = ["nsenter", "--target", str(box.machine.pid1), "--all", "/usr/bin/python3", "-c"]
    listener = subprocess.Popen([*entered, _LISTEN], stderr=subprocess.DEVNULL)
    network = box.hall.box_network if inside else box.hall.network
    with network.entered():
        caller = socket.socket(type=socket.SOCK_DGRAM)
    while listener.poll() is None:
        caller.sendto(b"hello", ("127.0.0.1" if inside else BOX, ROGUE))
        time.sleep(0.05)
    caller.close()
    return listener.returncode == 0
