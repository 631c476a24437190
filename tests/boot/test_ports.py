"""Nothing listens beyond what the box file says, and nothing else gets in."""

from __future__ import annotations

import socket
import subprocess
import time

import pytest

from tests.boot.box import Box
from tests.boot.hall import BOX, CONTROL, SENSORS

EPHEMERAL = 32768  # from here on the kernel gives ports to those who only send
PAGE = 8080  # of a box whose own file says nothing about it: appliance_box.yaml
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
    assert opened == {("udp", SENSORS), ("udp", CONTROL), ("tcp", PAGE)}, dancing.machine.run("ss", "-lunptp")


def test_the_firewall_lets_in_what_the_box_file_opens_and_nothing_else(dancing: Box) -> None:
    machine = dancing.machine
    dancing.await_unit("bunraku-firewall")
    dancing.await_unit("bunraku-control")
    assert dancing.hall.ask("/ping"), "a listed console is shut out"
    assert _heard(dancing, inside=True), "this test cannot tell what gets in"
    assert not _heard(dancing, inside=False), machine.run("nft", "list", "ruleset")


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
