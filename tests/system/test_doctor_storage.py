"""The doctor's checks of what keeps data: folders, partitions, sticks, wear, memory and swap."""

from __future__ import annotations

from pathlib import Path

from appliance.cli.doctor import storage
from appliance.cli.doctor.host_view import HostView
from appliance.show.box import BoxConfig
from tests.system.machine_of_files import lay, only, verdicts


def test_folders_that_cannot_be_written_or_are_not_named(tmp_path: Path) -> None:
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "better"
    state = BoxConfig.model_validate({"state": tmp_path / "state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=state))).verdict == "ok"
    nowhere = BoxConfig.model_validate({"state": "/proc/sys/state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=nowhere))).verdict in ("wrong", "better")  # no room in it


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
    assert "/var/swap" in swap.words
    assert "zram" not in swap.words
