"""Shows are copied whole or not at all from bad sticks, and dance from memory where the disk takes none."""

from __future__ import annotations

import ipaddress
import os
import re
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.release.adoption import adopt
from appliance.release.arrivals import Arrival, look
from appliance.release.choice import EMBEDDED_SHOW
from appliance.release.shelf import NoRoomError, Shelf, UnreadableError
from appliance.show.box import load_box
from tests.release.venue import Venue, dancing

_ROOT = Path(__file__).resolve().parents[2]
_ACCESS_POINT = _ROOT / "deploy/system/usr/sbin/bunraku-access-point"


def test_a_stick_that_is_pulled_while_it_is_read_is_looked_at_again(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    arrival = look("stick", venue.stick)
    (venue.stick / "show" / "puppet.onnx").unlink()
    outcome = adopt(venue.folders, [arrival], venue._check)
    assert outcome.choice.complete().first.show == EMBEDDED_SHOW
    assert "Plug it in again" in " ".join(outcome.choice.refused)
    assert not list((venue.folders.data / "shows").iterdir()), "a copy was left half-done"
    venue.bring(venue.stick, "spring")
    assert dancing(venue.look()) == "spring"


def test_a_file_that_ends_too_early_is_no_copy(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    arrival = look("stick", venue.stick)
    os.truncate(venue.stick / "show" / "puppet.onnx", 1000)
    with pytest.raises(UnreadableError, match="ends after 1000 of 300000 bytes"):
        Shelf(venue.folders.data).take_show(arrival)
    assert not list((venue.folders.data / "shows").iterdir())


def test_a_damaged_copy_gives_way_to_a_whole_one_in_one_step(
    venue: Venue, monkeypatch: pytest.MonkeyPatch
) -> None:
    venue.bring(venue.stick, "spring")
    shelf, arrival = Shelf(venue.folders.data), look("stick", venue.stick)
    identity, place = shelf.take_show(arrival)
    (place / "puppet.onnx").write_bytes(b"damaged")
    monkeypatch.setattr(Path, "rename", lambda *_: pytest.fail("a power cut would leave no show"))
    assert shelf.take_show(arrival) == (identity, place)
    assert (place / "puppet.onnx").stat().st_size == 300_000
    assert [one.name for one in place.parent.iterdir()] == [identity]


def test_a_stick_that_gives_errors_is_unreadable(venue: Venue) -> None:
    (venue.stick / "show").mkdir()
    (venue.stick / "show" / "show.yaml").symlink_to("/proc/self/mem")  # its first page: EIO
    arrival = Arrival("stick", venue.stick, [["show/show.yaml", 10, 0]])
    with pytest.raises(UnreadableError, match=r"cannot be read \(Input/output error\)"):
        Shelf(venue.folders.data).take_show(arrival)


def test_links_on_a_stick_lead_nowhere(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    (venue.stick / "show" / "secret").symlink_to("/etc/passwd")
    assert not (venue.look().choice.first.show / "secret").exists()


@pytest.fixture
def small_data(venue: Venue) -> Iterator[Path]:
    """A data partition of half a megabyte."""
    data = venue.folders.data
    mount = ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(data)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this user may not mount a file system")
    yield data
    subprocess.run(["umount", str(data)], check=True)


def test_a_full_disk_the_show_dances_from_memory(venue: Venue, small_data: Path) -> None:
    venue.bring(venue.stick, "spring")
    outcome = venue.look()
    assert dancing(outcome) == "spring"
    assert outcome.choice.first.show.is_relative_to(venue.folders.run)
    with pytest.raises(NoRoomError):
        Shelf(small_data).take_show(look("stick", venue.stick))


def test_a_read_only_disk_the_show_dances_from_memory(venue: Venue, small_data: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", str(small_data)], check=True)
    venue.bring(venue.stick, "spring", box="outputs: {osc: []}")
    outcome = venue.look()
    assert dancing(outcome) == "spring"
    assert outcome.choice.first.box.is_relative_to(venue.folders.run)
    assert "nothing can be kept there" in " ".join(outcome.messages)


def test_without_a_data_partition_the_show_dances_from_memory(venue: Venue) -> None:
    venue.folders.data.rmdir()
    venue.folders.data.symlink_to("/nowhere/at/all")
    venue.bring(venue.stick, "spring")
    assert dancing(venue.look()) == "spring"


def test_the_first_box_file_lets_a_phone_of_the_box_s_own_wifi_open_the_page(venue: Venue) -> None:
    page = (_ROOT / "docs/raspberry-pi.md").read_text("utf-8")
    written = re.search(r"```yaml\n(.+?)```", page, re.DOTALL)
    own = re.search(r"ipv4\.addresses ([\d./]+)", (_ACCESS_POINT).read_text())
    assert written and own
    venue.bring(venue.boot, "spring", textwrap.dedent(written[1]))
    console = load_box(venue.look().choice.complete().first.box).console
    assert console and console.https and console.host == "::"
    for phone in (ipaddress.ip_interface(own[1]).ip + 1, ipaddress.ip_address("fe80::1")):
        networks = map(ipaddress.ip_network, console.viewers)
        assert any(phone in one for one in networks), phone
