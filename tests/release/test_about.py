"""What the box says of itself: its shows, its releases, its addresses."""

from __future__ import annotations

import ipaddress
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.box import served as module
from appliance.box.served import addresses
from appliance.release import choice
from appliance.release.about import about, releases
from appliance.release.choice import Aside, Choice, ShowAndBox
from appliance.release.installed_box import box_here, show_and_box_here
from appliance.show.config_error import ConfigError


def test_the_shows_stand_in_the_order_in_which_they_are_tried(tmp_path: Path) -> None:
    venue = tmp_path / "venue.yaml"
    pairs = ShowAndBox(box=venue, id="a+b", source="from the stick"), ShowAndBox(good=True)
    chosen = tmp_path / "chosen.json"
    Choice(pairs, ("show.yaml:3: wrong.",), (Aside("c+", "It did not dance."),)).write(chosen)
    reported = about(chosen, None, tmp_path)
    assert reported["shows"] == [
        {"id": "a+b", "source": "from the stick", "good": False},
        {"id": "", "source": "comes with the box", "good": True},
    ]
    assert (reported["refused"], reported["aside"]) == (["show.yaml:3: wrong."], ["It did not dance."])
    assert reported["box_file"] == str(venue)
    json.dumps(reported)


@pytest.mark.parametrize("content", [None, "", "{", "[]", '{"pairs": 3}'])
def test_no_whole_choice_is_no_show(tmp_path: Path, content: str | None) -> None:
    chosen = tmp_path / "chosen.json"
    if content is not None:
        chosen.write_text(content)
    assert about(chosen, None, tmp_path)["shows"] == []


def test_releases_stand_in_the_order_in_which_they_came(tmp_path: Path) -> None:
    for name, number in (("0.9", "12"), ("1.0", "2"), ("1.1.part", "13"), ("torn", "x")):
        folder = tmp_path / "releases" / name
        folder.mkdir(parents=True)
        (folder / "number").write_text(number)
    (tmp_path / "current").symlink_to("releases/0.9")
    assert releases(tmp_path) == ["1.0", "0.9"]
    assert about(None, None, tmp_path)["release"] == "0.9"
    assert about(None, None, tmp_path / "nothing")["release"] is None


def test_only_addresses_that_others_can_use(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    table = tmp_path / "if_inet6"
    table.write_text(
        "00000000000000000000000000000001 01 80 10 80       lo\n"
        "fe800000000000000000000000000001 02 40 20 80     eth0\n"
        "20010db8000000000000000000000007 02 40 00 80     eth0\n"
    )
    monkeypatch.setattr(module, "_IPV6", table)
    found = addresses()
    assert ("eth0", "2001:db8::7") in found
    assert not any(ipaddress.ip_address(one).is_loopback for _, one in found)
    assert not any(one.startswith("fe80") for _, one in found)


NOBODY = 65534


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where an installed box meets, before anything was chosen."""
    folder = tmp_path / "run"
    folder.mkdir(mode=0o700)
    monkeypatch.setattr(choice, "RUN", folder)
    return folder


def test_without_an_installed_box_nothing_is_meant(run: Path) -> None:
    assert box_here(None) is None
    assert show_and_box_here(None, None) == (None, None)


def test_what_was_chosen_at_power_on_is_meant_unless_a_file_is_given(run: Path, tmp_path: Path) -> None:
    show, box, other = tmp_path / "show", tmp_path / "box.yaml", tmp_path / "other.yaml"
    Choice((ShowAndBox(show, box),)).write(run / choice.CHOSEN)
    assert box_here(None) == box
    assert box_here(other) == other
    assert show_and_box_here(None, None) == (show, box)
    assert show_and_box_here(None, other) == (None, other)


def test_both_are_refused(run: Path, tmp_path: Path) -> None:
    Choice((ShowAndBox(),)).write(run / choice.CHOSEN)
    with pytest.raises(ConfigError, match="not both"):
        box_here(tmp_path / "box.yaml", run / choice.CHOSEN)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_root_goes_on_as_the_user_of_the_box_and_others_are_told_to_be_root(run: Path) -> None:
    Choice((ShowAndBox(),)).write(run / choice.CHOSEN)
    for path in (run, run / choice.CHOSEN):
        os.chown(path, NOBODY, NOBODY)
    assert "uid 65534" in _said(run, "show_and_box_here(None, None); print('uid', os.geteuid())")
    closed = _said(run, "os.setuid(12345); box_here(None)")
    assert "closed to this user. Put sudo before the command" in closed


def _said(run: Path, message: str) -> str:
    program = (
        "import os, pathlib\n"
        "from appliance.release.installed_box import box_here, show_and_box_here\n"
        "from appliance.release import choice\n"
        "from appliance.show import config_error\n"
        f"choice.RUN = pathlib.Path({str(run)!r})\n{message}"
    )
    done = subprocess.run((sys.executable, "-c", program), capture_output=True, text=True)
    return done.stdout + done.stderr
