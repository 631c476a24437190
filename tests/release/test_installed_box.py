"""Commands without a file take what the installed box chose at power-on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.release import choice
from appliance.release.choice import Choice, Pair
from appliance.release.installed_box import box_here, pair_here
from appliance.show.config_error import ConfigError

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
    assert pair_here(None, None) == (None, None)


def test_what_was_chosen_at_power_on_is_meant_unless_a_file_is_given(run: Path, tmp_path: Path) -> None:
    show, box, other = tmp_path / "show", tmp_path / "box.yaml", tmp_path / "other.yaml"
    Choice((Pair(show, box),)).write(run / choice.CHOSEN)
    assert box_here(None) == box
    assert box_here(other) == other
    assert pair_here(None, None) == (show, box)
    assert pair_here(None, other) == (None, other)


def test_both_are_refused(run: Path, tmp_path: Path) -> None:
    Choice((Pair(),)).write(run / choice.CHOSEN)
    with pytest.raises(ConfigError, match="not both"):
        box_here(tmp_path / "box.yaml", run / choice.CHOSEN)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_root_goes_on_as_the_user_of_the_box_and_others_are_told_to_be_root(run: Path) -> None:
    Choice((Pair(),)).write(run / choice.CHOSEN)
    for path in (run, run / choice.CHOSEN):
        os.chown(path, NOBODY, NOBODY)
    assert "uid 65534" in _said(run, "pair_here(None, None); print('uid', os.geteuid())")
    closed = _said(run, "os.setuid(12345); box_here(None)")
    assert "closed to this user. Put sudo before the command" in closed


def _said(run: Path, message: str) -> str:
    program = (
        "import os, pathlib\n"
        "from appliance.release.installed_box import box_here, pair_here\n"
        "from appliance.release import choice\n"
        "from appliance.show import config_error\n"
        f"choice.RUN = pathlib.Path({str(run)!r})\n{message}"
    )
    done = subprocess.run((sys.executable, "-c", program), capture_output=True, text=True)
    return done.stdout + done.stderr
