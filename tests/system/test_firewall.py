"""The firewall admits what a running box listens to beyond loopback and nothing else; nft takes its rules."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from appliance.cli.firewall import rules
from appliance.show.box import load_box
from tests.bundles import write_show
from tests.system.box import playing
from tests.system.processes import children, run

LISTED = re.compile(r"^UNCONN\s+\d+\s+\d+\s+(\S+?)(?:%\w+)?:(\d+)\s", re.MULTILINE)


def box_file(folder: Path, text: str) -> Path:
    path = folder / "box.yaml"
    path.write_text(text)
    return path


def opened(text: str) -> set[int]:
    """Ports that the rules open to the network, without those for DHCP and DNS."""
    return {int(port) for port in re.findall(r"udp dport (\d+) accept", text)} - {67, 68, 53}


def test_a_box_on_loopback_opens_nothing() -> None:
    assert opened(rules(load_box(None))) == set()


def test_sensors_are_let_in_where_the_box_listens(tmp_path: Path) -> None:
    path = box_file(tmp_path, "sensors: {udp: {host: 192.168.4.1, port: 9751}}\n")
    assert "ip daddr 192.168.4.1 udp dport 9751 accept" in rules(load_box(path))


def test_commands_are_let_in_from_listed_senders_alone(tmp_path: Path) -> None:
    senders = "[192.168.0.20, 192.168.4.0/24]"
    path = box_file(tmp_path, f"control: {{host: 0.0.0.0, port: 9002, senders: {senders}}}\n")
    text = rules(load_box(path))
    assert "ip saddr { 192.168.0.20/32, 192.168.4.0/24 } udp dport 9002 accept" in text
    assert opened(text) == {9002}


def test_the_page_is_let_in_from_listed_viewers_alone(tmp_path: Path) -> None:
    path = box_file(tmp_path, "console: {host: '::', port: 8081, viewers: [192.168.0.0/24, 'fd00::/8']}\n")
    text = rules(load_box(path))
    assert 'ip saddr { 192.168.0.0/24 } tcp dport 8081 accept comment "the page"' in text
    assert 'ip6 saddr { fd00::/8 } tcp dport 8081 accept comment "the page"' in text
    assert "tcp dport" not in rules(load_box(None))


def test_the_stream_is_let_in_from_listed_viewers_alone(tmp_path: Path) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("projector:\n  stream: {host: 0.0.0.0, port: 8097, viewers: [192.168.0.0/24]}\n")
    assert 'ip saddr { 192.168.0.0/24 } tcp dport 8097 accept comment "the stream"' in rules(load_box(box))


def test_an_access_point_gives_addresses() -> None:
    text = rules(load_box(None), ["wlan0"])
    assert 'iifname "wlan0" udp dport 67 accept' in text


def test_nft_takes_the_rules_twice(tmp_path: Path) -> None:
    if shutil.which("nft") is None:
        pytest.skip("nft is not on this machine (Debian package nftables)")
    path = box_file(
        tmp_path,
        "sensors: {udp: {host: 0.0.0.0, port: 9750}}\n"
        "control: {host: 0.0.0.0, port: 9002, senders: [192.168.0.0/24]}\n",
    )
    (tmp_path / "rules").write_text(rules(load_box(path), ["wlan0"]))
    twice = f"nft -f {tmp_path}/rules && nft -f {tmp_path}/rules && nft list ruleset"
    done = run(["unshare", "--net", "sh", "-c", twice])
    if "Operation not permitted" in done.stderr:
        pytest.skip("this machine does not allow network namespaces")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("udp dport 9750") == 1, "the old rules are replaced"
    assert done.stdout.count("policy drop") == 2


def test_what_the_rules_let_in_is_what_a_running_box_listens_to(tmp_path: Path) -> None:
    if shutil.which("ss") is None:
        pytest.skip("ss is not on this machine (Debian package iproute2)")
    show = write_show(tmp_path / "show")
    settings = {"control": None}
    with playing(show, tmp_path, settings=settings) as box:
        box.frames(1)
        assert listened_to(box.process.pid) == set()
        assert box.end() == 0
    settings = {
        "sensors": {"udp": {"host": "0.0.0.0", "port": box.sensors}},
        "control": {"host": "0.0.0.0", "port": box.control, "senders": ["192.168.0.20"]},
    }
    folder = tmp_path / "open"
    folder.mkdir()
    with playing(show, folder, settings=settings) as box:
        box.frames(60)
        assert listened_to(box.process.pid) == opened(rules(load_box(folder / "box.yaml")))
        assert box.end() == 0


def listened_to(pid: int) -> set[int]:
    """UDP ports of a box and its companions that other machines can reach."""
    pids = {pid, *children(pid)}
    ports = set()
    listed = run(["ss", "-lunpH"], check=True).stdout
    for line in listed.splitlines():
        found = LISTED.match(line)
        owners = {int(one) for one in re.findall(r"pid=(\d+)", line)}
        if found and owners & pids and not found[1].startswith("127."):
            ports.add(int(found[2]))
    tcp = run(["ss", "-ltnpH"], check=True).stdout
    assert not {int(one) for one in re.findall(r"pid=(\d+)", tcp)} & pids, "no TCP port was opened"
    return ports
