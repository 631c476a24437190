"""The doctor's checks of what keeps data: folders, partitions, sticks, wear, memory and swap."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from appliance.cli.doctor import storage
from appliance.cli.doctor.host_view import HostView
from appliance.show.box import BoxConfig
from tests.system.machine_of_files import lay, only, verdicts


def test_folders_that_cannot_be_written_or_are_not_named(tmp_path: Path) -> None:
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "better"
    state = BoxConfig.model_validate({"state": tmp_path / "state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=state))).verdict == "ok"
    nowhere = state.model_copy(update={"state": Path("/proc/sys/state")})  # a box file could not name it
    assert only(storage.data_folders(HostView(box=nowhere))).verdict in ("wrong", "better")  # no room in it


PI = "overlayroot / overlay rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/w 0 0"
PI_MEMORY = "tmpfs-root /media/root-rw tmpfs rw,relatime 0 0"
IMAGE = "overlay / overlay rw,lowerdir=/l,upperdir=/run/bunraku-root/written,workdir=/w 0 0"
RUN = "tmpfs /run tmpfs rw,nosuid 0 0"
CARD = "/dev/mmcblk0p3 /data ext4 rw,noatime 0 0"
OVER_CARD = "/dev/mmcblk0p3 /data overlay rw,lowerdir=/m,upperdir=/media/root-rw/overlay/data,workdir=/w 0 0"


@pytest.mark.parametrize(
    ("mounted", "is_kept"),
    [
        (["/dev/mmcblk0p2 / ext4 rw,noatime 0 0"], True),
        ([PI_MEMORY, PI], False),
        ([PI], False),  # what lies under the root's overlay is not seen any more
        ([PI_MEMORY, PI, CARD], True),
        ([PI_MEMORY, PI, CARD, OVER_CARD], False),  # overlayroot takes other partitions too
        ([RUN, IMAGE], False),
        ([RUN, IMAGE, CARD], True),
        (["/dev/sda2 / ext4 rw 0 0", "tmpfs /data tmpfs rw 0 0"], False),
        (["/dev/sda2 / ext4 rw 0 0", "/dev/zram1 /data ext4 rw 0 0"], False),
        (["/dev/sda2 / ext4 rw 0 0", "o /data overlay rw,lowerdir=/a,upperdir=/var/b,workdir=/c 0 0"], True),
    ],
)
def test_data_that_lies_in_memory_is_wrong_whatever_holds_it(
    tmp_path: Path, mounted: list[str], is_kept: bool
) -> None:
    (tmp_path / "data/bunraku/keys").mkdir(parents=True)
    lay(tmp_path, "/proc/mounts", "\n".join(mounted) + "\n")
    keys = {"sensors": {"keys": "/data/bunraku/keys/sensors.keys"}, "state": "/data/bunraku/state"}
    box = BoxConfig.model_validate(keys, context={"directory": tmp_path})
    found = list(storage.data_folders(HostView(tmp_path, box)))
    assert {one.verdict for one in found} == {"ok" if is_kept else "wrong"}
    assert len(found) == 3, "the keys' folder, the state and what the box keeps besides"
    assert is_kept or all("in memory" in one.message and "keys" in one.message for one in found)
    assert not list((tmp_path / "data").rglob(".doctor-*"))


def test_mountinfo_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "data/bunraku").mkdir(parents=True)
    lay(
        tmp_path,
        "/proc/self/mountinfo",
        "22 1 0:25 / /media/root-rw rw,relatime - tmpfs tmpfs-root rw\n"
        "23 1 0:24 / / rw,relatime shared:1 - overlay overlayroot "
        "rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/media/root-rw/overlay-workdir\n",
    )
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "wrong"


def test_a_disk_that_forgets_what_is_written_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = BoxConfig.model_validate({"state": tmp_path}, context={"directory": tmp_path})
    drop = os.posix_fadvise

    def forget(descriptor: int, start: int, length: int, advice: int) -> None:
        os.pwrite(descriptor, b"\0" * 4096, 0)
        drop(descriptor, start, length, advice)

    monkeypatch.setattr(os, "posix_fadvise", forget)
    found = only(storage.data_folders(HostView(box=state)))
    assert found.verdict == "wrong" and "came back changed" in found.message


def test_a_data_folder_without_a_journal_of_its_own_can_be_damaged_by_a_power_cut(tmp_path: Path) -> None:
    (tmp_path / "data/bunraku").mkdir(parents=True)
    lay(tmp_path, "/proc/mounts", "/dev/sda1 / ext4 rw 0 0\n/dev/sdb1 /data vfat rw 0 0\n")
    found = only(storage.data_folders(HostView(tmp_path)))
    assert found.verdict == "better" and "It is on vfat" in found.message
    lay(tmp_path, "/proc/mounts", "/dev/sda1 / ext4 rw 0 0\n/dev/sdb1 /data ext4 rw 0 0\n")
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "ok"


def test_a_missing_data_partition(tmp_path: Path) -> None:
    lay(tmp_path, "/etc/fstab", "# a comment\nLABEL=data /data ext4 nofail 0 2\n")
    lay(tmp_path, "/proc/mounts", "overlay / overlay rw 0 0\n/dev/sdb1 /media/bunraku vfat ro 0 0\n")
    assert verdicts(storage.media(HostView(tmp_path))) == [("data partition", "wrong"), ("stick", "ok")]
    lay(tmp_path, "/proc/mounts", "overlay / overlay rw 0 0\n/dev/sda4 /data ext4 rw 0 0\n")
    assert verdicts(storage.media(HostView(tmp_path))) == [("data partition", "ok")]


def test_wear(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/block/mmcblk0/device/life_time", "0x02 0x09\n")
    lay(tmp_path, "/sys/block/mmcblk0/device/type", "MMC\n")
    lay(tmp_path, "/sys/block/mmcblk1/device/type", "SD\n")
    assert verdicts(storage.wear(HostView(tmp_path))) == [
        ("wear of mmcblk0", "wrong"),
        ("wear of mmcblk1", "ok"),
    ]


def test_memory_and_swap(tmp_path: Path) -> None:
    lay(tmp_path, "/proc/meminfo", "MemTotal: 4000000 kB\nMemAvailable:  90000 kB\n")
    lay(tmp_path, "/proc/swaps", "Filename Type\n/dev/zram0 partition 1\n/var/swap file 1\n")
    memory, swap = storage.memory(HostView(tmp_path))
    assert (memory.verdict, swap.verdict) == ("wrong", "better")
    assert "/var/swap" in swap.message
    assert "zram" not in swap.message
