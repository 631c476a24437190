"""A box whose data lies in memory says so at once, not after the night in which it forgot its sensors."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.box import mounts
from appliance.box.mounts import memory_of
from appliance.box.process_health import ProcessHealth
from appliance.cli.sensors.box_keys import forgotten
from appliance.keeper.fallback import SAVED_IN_MEMORY
from appliance.keeper.keeper import KeeperHealth

OVERLAY = (
    "22 1 0:25 / /media/root-rw rw,relatime - tmpfs tmpfs-root rw\n"
    "23 1 0:24 / / rw,relatime shared:1 - overlay overlayroot "
    "rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/media/root-rw/overlay-workdir\n"
)
PARTITION = "24 23 179:3 / /data rw,noatime shared:2 - ext4 /dev/mmcblk0p3 rw\n"
STATE = Path("/data/bunraku/state")


def lay_mounts(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "mountinfo").write_text(text)
    monkeypatch.setattr(mounts, "MOUNTINFO", folder / "mountinfo")


@pytest.mark.parametrize(("text", "memory"), [(OVERLAY, "overlay (/)"), (OVERLAY + PARTITION, ""), ("", "")])
def test_a_box_that_keeps_everything_in_memory_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, memory: str
) -> None:
    lay_mounts(tmp_path, text, monkeypatch)
    assert memory_of(STATE) == memory
    keeper = KeeperHealth(tmp_path, STATE)
    keeper.report([], 10.0)
    reported = [one for _, one in ProcessHealth(tmp_path).fallbacks(10.0)]
    assert [(one.name, one.active, one.about) for one in reported] == (
        [(SAVED_IN_MEMORY.name, True, memory)] if memory else []
    )
    assert bool(memory) == ("gone at power-off" in forgotten(Path("/data/bunraku/keys/sensors.keys")))
    keeper.end(11.0)


def test_a_box_that_nobody_installed_may_keep_things_where_it_likes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lay_mounts(tmp_path, OVERLAY, monkeypatch)
    keeper = KeeperHealth(tmp_path)
    keeper.report([], 10.0)
    assert ProcessHealth(tmp_path).fallbacks(10.0) == []
    keeper.end(11.0)


def test_disks_are_named_as_people_find_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lay_mounts(
        tmp_path, OVERLAY + PARTITION + "25 23 8:1 / /mnt/a\\040disk rw - ext4 /dev/sda1 rw\n", monkeypatch
    )
    assert mounts.disk_of(STATE) == "mmcblk0p3 (/data)"
    assert mounts.disk_of(Path("/mnt/a disk/journal")) == "sda1 (/mnt/a disk)"
    assert mounts.disk_of(Path("/home")) == "overlay (/)"
