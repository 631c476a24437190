"""Shell scripts of the box: shellcheck finds nothing, and the access point is what it says."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess
from pathlib import Path
from typing import ClassVar

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
    for arguments, message in (
        (("--channel", "3"), "overlaps its neighbours"),
        (("--password", "short"), "this one has 5"),
        (("--nonsense",), "usage:"),
        (("--remove",), "this box was no access point"),
    ):
        done = access_point(tmp_path, *arguments)
        assert done.returncode != 0
        assert message in done.stderr
    assert list(tmp_path.iterdir()) == []
    assert "data partition" in access_point(tmp_path / "missing").stderr


class RadioBox:
    """A box of files with a radio, wlan1, and stand-ins for the programs that ask and set it."""

    TOOLS: ClassVar = {
        "iw": 'case "$1 $2" in "phy "*) echo "\t\t * managed"; [ -e {0}/no-ap ] || echo "\t\t * AP";;\n'
        '"reg get") echo "country $(cat {0}/known): DFS-UNSET";; "reg set") echo "$3" >{0}/set;;\n'
        '"dev "*) [ ! -e {0}/on-air ] || printf "\tssid bunraku\n\ttype AP\n";; esac',
        "ip": '[ ! -e {0}/on-air ] || echo "wlan1 UP 10.77.0.1/24"',
        "nmcli": 'case $1 in --offline) echo "ssid=bunraku"; echo "psk=curtain up";;\n'
        '*) echo "36 (The Wi-Fi network could not be found)";; esac',
        "systemctl": '[ ! -e {0}/starts ] || touch {0}/on-air; echo "$@" >>{0}/systemctl',
    }

    def __init__(self, folder: Path) -> None:
        self.folder, self.networks, self.card = folder, folder / "network", folder / "sys/class/net/wlan1"
        self.switch = self.card / "phy80211/rfkill0"
        for made in (self.networks, self.switch, folder / "bin", folder / "sys/class/net/eth0"):
            made.mkdir(parents=True)
        (self.card / "phy80211/name").write_text("phy1\n")
        (self.switch / "hard").write_text("0\n")
        (self.switch / "soft").write_text("1\n")
        (folder / "known").write_text("00")
        for name, lines in self.TOOLS.items():
            tool = folder / "bin" / name
            tool.write_text("#!/bin/sh\n" + lines.replace("{0}", str(folder)) + "\n")
            tool.chmod(0o755)

    def run(self, *arguments: str, is_on: bool = True) -> subprocess.CompletedProcess[str]:
        systemd = self.folder if is_on else self.folder / "none"
        return subprocess.run(
            [ACCESS_POINT, *arguments],
            capture_output=True,
            text=True,
            check=False,
            env={
                "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
                "BUNRAKU_NETWORKS": str(self.networks),
                "BUNRAKU_SYS": str(self.folder / "sys"),
                "BUNRAKU_SYSTEMD": str(systemd),
                "BUNRAKU_ON_AIR_S": "0",
            },
        )


@pytest.fixture
def radio(tmp_path: Path) -> RadioBox:
    return RadioBox(tmp_path)


def test_a_radio_that_cannot_be_on_the_air_is_refused_with_its_reason(radio: RadioBox) -> None:
    def refused(*arguments: str) -> str:
        done = radio.run(*arguments)
        assert done.returncode == 1 and "Nothing was changed." in done.stderr
        assert list(radio.networks.iterdir()) == [] and not (radio.folder / "systemctl").exists()
        return done.stderr

    assert "no network card wlan7. Nothing was changed. Wi-Fi cards here: wlan1." in refused(
        "--card", "wlan7"
    )
    assert "eth0 is no Wi-Fi card" in refused("--card", "eth0")
    assert "--country DE" in refused("--card", "wlan1")
    (radio.switch / "hard").write_text("1\n")
    assert "switched off by a switch" in refused("--card", "wlan1", "--country", "DE")
    (radio.folder / "no-ap").touch()
    assert "cannot be an access point" in refused("--card", "wlan1", "--country", "DE")
    shutil.rmtree(radio.card)
    assert "There is no Wi-Fi card here" in refused("--card", "wlan1", "--country", "DE")


def test_done_is_said_only_of_a_network_that_is_on_the_air(radio: RadioBox) -> None:
    done = radio.run("--card", "wlan1", "--country", "DE")
    assert done.returncode == 1
    assert "wlan1 is not on the air after 0 s (36 (The Wi-Fi network could not be found))" in done.stderr
    assert "The box is the access point" not in done.stdout
    (radio.folder / "starts").touch()
    done = radio.run("--card", "wlan1")  # the country from before
    assert done.returncode == 0, done.stderr
    assert "The box is the access point 'bunraku' on wlan1, channel 6, country DE" in done.stdout
    assert (radio.switch / "soft").read_text() == "0\n", "the radio was switched on"
    assert (radio.folder / "set").read_text() == "DE\n"
    assert (radio.networks / "country").read_text() == "COUNTRY=DE\n"
    assert radio.run("--remove").returncode == 0
    assert list(radio.networks.iterdir()) == []


def test_a_radio_that_tells_much_is_heard_to_the_end(radio: RadioBox) -> None:
    """The answer of `iw phy` has many kB after the line that counts."""
    (radio.folder / "bin/iw").write_text(
        '#!/bin/sh\n[ $1 = phy ] || exit 0\necho "\t\t * AP"\nsleep 0.2\nyes "\t* 2412 MHz" | head -n 20000\n'
    )
    done = radio.run("--card", "wlan1", "--country", "DE", is_on=False)
    assert done.returncode == 0, done.stderr


def test_a_password_with_a_backslash_stays_the_same(radio: RadioBox) -> None:
    (radio.folder / "bin/nmcli").write_text(
        '#!/bin/sh\nwhile [ $# -gt 0 ]; do\n[ "$1" != wifi-sec.psk ] ||\n'
        "printf 'psk=%s\\n' \"$2\" | sed 's/\\\\/&&/g; s/= /=\\\\s/'; shift\ndone\n"
    )
    given = r" a\s\curtain "
    assert radio.run("--card", "wlan1", "--country", "DE", "--password", given, is_on=False).returncode == 0
    before = (radio.networks / "sensors.nmconnection").read_text()
    assert before == r"psk=\sa\\s\\curtain " + "\n", before
    assert radio.run("--card", "wlan1", "--channel", "11", is_on=False).returncode == 0
    assert (radio.networks / "sensors.nmconnection").read_text() == before


def test_a_country_that_the_system_knows_is_taken(radio: RadioBox) -> None:
    (radio.folder / "known").write_text("CH")
    (radio.folder / "starts").touch()
    done = radio.run("--card", "wlan1")
    assert done.returncode == 0 and "country CH" in done.stdout, done.stderr


def test_a_system_that_does_not_run_is_prepared_and_says_so(radio: RadioBox) -> None:
    done = radio.run("--card", "wlan1", "--country", "DE", is_on=False)
    assert done.returncode == 0
    assert "This system does not run" in done.stdout and "The box is the access point" not in done.stdout
    assert not (radio.folder / "systemctl").exists()


@needs_nmcli
def test_an_access_point_is_kept_whole_and_keeps_its_password(radio: RadioBox) -> None:
    (radio.folder / "bin/nmcli").unlink()  # the real one
    tmp_path = radio.networks
    done = radio.run("--card", "wlan1", "--country", "DE", "--channel", "11", is_on=False)
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
    again = radio.run("--card", "wlan1", is_on=False)
    assert "password:" not in again.stdout
    assert f"psk={security['psk']}\n" in (tmp_path / "sensors.nmconnection").read_text()
    assert radio.run("--remove", is_on=False).returncode == 0
    assert list(tmp_path.iterdir()) == []
