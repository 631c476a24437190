"""Shell scripts of the box: shellcheck finds nothing, and the access point is what it says."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess
from pathlib import Path

import pytest

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
ACCESS_POINT = DEPLOY / "system/usr/sbin/bunraku-access-point"
SCRIPTS = sorted(
    path
    for path in DEPLOY.rglob("*")
    if path.is_file() and path.read_bytes().startswith((b"#!/bin/sh", b"#!/bin/bash"))
)
needs_nmcli = pytest.mark.skipif(
    shutil.which("nmcli") is None, reason="nmcli is missing: apt-get install network-manager"
)


def access_point(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ACCESS_POINT, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "BUNRAKU_NETWORKS": str(folder)},
    )


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_script_has_no_trap_that_shellcheck_knows(script: Path) -> None:
    if shutil.which("shellcheck") is None:
        pytest.skip("shellcheck is missing: apt-get install shellcheck")
    # SC2154: a variable that another file, which the script reads, has set.
    done = subprocess.run(
        ["shellcheck", "--severity=warning", "--exclude=SC2154", str(script)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_an_access_point_that_cannot_be_is_refused_before_anything_changes(tmp_path: Path) -> None:
    for arguments, words in (
        (("--channel", "3"), "overlaps its neighbours"),
        (("--password", "short"), "this one has 5"),
        (("--nonsense",), "usage:"),
    ):
        done = access_point(tmp_path, *arguments)
        assert done.returncode != 0
        assert words in done.stderr
    assert list(tmp_path.iterdir()) == []
    assert "data partition" in access_point(tmp_path / "missing").stderr


@needs_nmcli
def test_an_access_point_is_kept_whole_and_keeps_its_password(tmp_path: Path) -> None:
    done = access_point(tmp_path, "--card", "wlan1", "--channel", "11")
    assert done.returncode == 0, done.stderr
    profile = configparser.ConfigParser(delimiters=("=",), strict=True)
    profile.read(tmp_path / "sensors.nmconnection")
    assert profile["connection"]["interface-name"] == "wlan1"
    assert (profile["wifi"]["mode"], profile["wifi"]["channel"]) == ("ap", "11")
    assert (profile["wifi"]["band"], profile["wifi"]["powersave"]) == ("bg", "2")
    security = profile["wifi-security"]
    assert (security["key-mgmt"], security["pairwise"], security["pmf"]) == ("wpa-psk", "ccmp;", "1")
    assert f"password: {security['psk']}" in done.stdout
    assert profile["ipv4"]["method"] == "shared"
    assert (tmp_path / "sensors.nmconnection").stat().st_mode & 0o077 == 0
    assert (tmp_path / "firewall.env").read_text() == 'FIREWALL_OPTIONS="--access-point wlan1"\n'
    again = access_point(tmp_path, "--card", "wlan0")
    assert "password:" not in again.stdout
    assert f"psk={security['psk']}\n" in (tmp_path / "sensors.nmconnection").read_text()
    assert access_point(tmp_path, "--remove").returncode == 0
    assert list(tmp_path.iterdir()) == []
