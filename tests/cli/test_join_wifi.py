"""The Wi-Fi of a new box: what is read, kept, applied and said, without a radio."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from appliance.cli import join_wifi as join_wifi_module
from appliance.cli.console import card_lines
from appliance.cli.join_wifi import MESSAGE_FILE, NETWORK_FILE, WifiFolders, join_wifi
from appliance.pose.foreign_file import content
from appliance.release.wifi import NAME, PROFILE
from appliance.show import yaml_file
from appliance.show.box import BoxConfig
from appliance.show.yaml_file import MAX_BYTES

GOOD = "country: DE\nname: hall\npassword: correct horse\nhostname: puppet\n"
AP = GOOD + "access_point: yes\nchannel: 11\n"


@dataclass
class Box:
    """A box of folders; `fails`: programs that end with 1 and these words."""

    folder: Path
    fails: dict[str, str] = field(default_factory=dict)
    ran: list[tuple[str, ...]] = field(default_factory=list)
    named: str = ""
    waited_s: float = 0.0
    on_command: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        for name in ("stick", "boot", "kept", "run", "cards/wlan7/phy80211"):
            (self.folder / name).mkdir(parents=True)
        self.folders = WifiFolders(
            (self.folder / "stick", self.folder / "boot"),
            self.folder / "kept",
            self.folder / "run",
            self.folder / "profiles",
            self.folder / "cards",
        )

    def power_on(self) -> int:
        self.ran.clear()
        return join_wifi(self.folders, self._run, self._wait, self._name)

    @property
    def output(self) -> str:
        path = self.folder / "run" / MESSAGE_FILE
        return path.read_text() if path.exists() else ""

    def _run(self, command: Sequence[str]) -> subprocess.CompletedProcess[str]:
        self.ran.append(tuple(command))
        self.on_command()
        output = self.fails.get(command[0])
        return subprocess.CompletedProcess(command, output is not None, "", output or "")

    def _wait(self, seconds: float) -> None:
        self.waited_s += seconds

    def _name(self, name: str) -> None:
        self.named = name


@pytest.fixture
def box(tmp_path: Path) -> Box:
    return Box(tmp_path)


def test_without_a_file_nothing_is_done(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text("# country: DE\n\n")
    assert box.power_on() == 0
    assert not box.ran
    assert not list((box.folder / "kept").iterdir())


def test_the_network_on_the_card_is_joined_and_kept(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    assert box.power_on() == 0
    for folder in ("kept", "profiles"):
        path = box.folder / folder / PROFILE
        assert "psk=correct horse" in path.read_text()
        assert path.stat().st_mode & 0o077 == 0, "nobody else reads the password"
    assert (box.folder / "kept" / "country").read_text() == "COUNTRY=DE\n"
    assert (box.folder / "kept" / NAME).stat().st_mode & 0o077 == 0
    assert ("iw", "reg", "set", "DE") in box.ran
    assert box.named == "puppet"
    assert box.output == ""


def test_the_stick_counts_before_the_card_and_outlives_being_pulled(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    (box.folder / "stick" / NAME).write_text(GOOD.replace("puppet", "other"))
    box.power_on()
    assert box.named == "other"
    (box.folder / "stick" / NAME).unlink()
    (box.folder / "boot" / NAME).unlink()
    box.power_on()
    assert box.named == "other"


def test_a_stick_that_is_pulled_while_its_network_is_looked_for_has_done_its_work(box: Box) -> None:
    stick = box.folder / "stick" / NAME
    stick.write_text(GOOD)
    box.on_command = lambda: stick.unlink(missing_ok=True)
    assert box.power_on() == 0 and not stick.exists()
    assert (box.folder / "kept" / NAME).read_text() == GOOD
    box.named = ""
    box.power_on()
    assert box.named == "puppet"


def test_a_file_is_read_once(box: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stored file is the applied one, also when the stick is written to meanwhile."""
    stick = box.folder / "stick" / NAME
    stick.write_text(GOOD)
    looks = list[bytes]()

    def content_once(path: Path, largest: int) -> bytes:
        data = content(path, largest)
        looks.append(data)
        stick.write_text(GOOD.replace("hall", "elsewhere"))
        return data

    monkeypatch.setattr(join_wifi_module, "content", content_once)
    monkeypatch.setattr(yaml_file, "content", content_once)
    assert box.power_on() == 0 and looks == [GOOD.encode()]
    assert (box.folder / "kept" / NAME).read_text() == GOOD
    assert "id=wifi" in (box.folder / "kept" / PROFILE).read_text()
    ssid = "".join(f"{byte};" for byte in b"hall")
    assert f"ssid={ssid}" in (box.folder / "kept" / PROFILE).read_text()


def test_a_file_without_end_is_refused(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD + "#\n" * MAX_BYTES)
    assert box.power_on() == 1
    assert "it is larger than 256 kB" in box.output and "keeps the network from before" in box.output


def test_a_fault_is_said_with_its_line_and_the_network_before_stays(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    box.power_on()
    before = (box.folder / "kept" / PROFILE).read_bytes()
    (box.folder / "boot" / NAME).write_text(GOOD.replace("password", "pasword"))
    assert box.power_on() == 1
    assert f"{NAME}:3: Unknown key 'pasword'." in box.output
    assert "keeps the network from before" in box.output
    assert not box.ran
    assert (box.folder / "kept" / PROFILE).read_bytes() == before


def test_a_fault_is_on_the_test_card(box: Box) -> None:
    (box.folder / "run").chmod(0o700)
    config = BoxConfig(runtime=box.folder / "run")
    assert card_lines(config) == ()
    (box.folder / "boot" / NAME).write_text(GOOD.replace("password", "pasword"))
    box.power_on()
    lines = card_lines(config)
    assert "Unknown key 'pasword'." in " ".join(lines)
    assert 1 < len(lines) <= 5
    assert max(map(len, lines)) <= 40


def test_a_network_that_is_not_joined_is_said_and_tried_again(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    box.fails["nmcli"] = "Error: Connection activation failed: Secrets were required\n"
    assert box.power_on() == 1
    assert (
        "not in the Wi-Fi 'hall' (Error: Connection activation failed: Secrets were required)" in box.output
    )
    assert (box.folder / "kept" / PROFILE).exists(), "NetworkManager goes on trying"
    box.fails.clear()
    assert box.power_on() == 0
    assert box.output == ""


def test_the_box_makes_the_network_itself(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    box.power_on()
    (box.folder / "boot" / NAME).write_text(AP)
    assert box.power_on() == 0
    options = ["--card", "wlan7", "--country", "DE", "--name", "hall", "--password"]
    assert box.ran[-1] == ("bunraku-access-point", *options, "correct horse", "--channel", "11")
    assert not (box.folder / "kept" / PROFILE).exists(), "it does not look for it as well"
    box.power_on()
    assert "bunraku-access-point" not in [command[0] for command in box.ran], "it is kept over power-off"


def test_its_own_network_is_on_the_test_card_until_there_is_none(box: Box) -> None:
    (box.folder / "run").chmod(0o700)
    config, made = BoxConfig(runtime=box.folder / "run"), box.folder / "kept" / "sensors.nmconnection"
    made.write_text("[wifi]\nssid=hall\n\n[wifi-security]\npsk=two\\\\slashes\\s\n")
    box.power_on()
    assert card_lines(config) == ("wi-fi hall", "password two\\slashes ")
    assert (box.folder / "run" / NETWORK_FILE).stat().st_mode & 0o077 == 0
    made.unlink()
    box.power_on()
    assert card_lines(config) == ()


def test_an_access_point_that_fails_is_said_and_tried_at_the_next_power_on(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(AP)
    box.fails["bunraku-access-point"] = "the radio of wlan7 cannot be an access point."
    assert box.power_on() == 1
    assert box.output == "the radio of wlan7 cannot be an access point.\n"
    box.fails.clear()
    assert box.power_on() == 0


def test_a_box_without_a_card_waits_for_one_and_says_so(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    (box.folder / "cards/wlan7/phy80211").rmdir()
    assert box.power_on() == 1
    assert "no Wi-Fi card" in box.output
    assert box.waited_s >= 10


def test_a_disk_that_cannot_be_written_is_said(box: Box) -> None:
    (box.folder / "boot" / NAME).write_text(GOOD)
    (box.folder / "kept").rmdir()
    assert box.power_on() == 1
    assert "cannot be written" in box.output
