"""The parts of a Raspberry Pi's card, from a root of empty files: tables, loader, the same bytes twice."""

from __future__ import annotations

import configparser
import json
import os
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT

IMAGE = ROOT / "deploy" / "image"
KERNEL = "7.3.4+deb13-arm64"
MIB = 1 << 20
BOOT = "@@2M"
NEEDED = ("mksquashfs", "mcopy", "mkfs.vfat", "sfdisk", "mke2fs", "depmod", "cpio", "zstd")

pytestmark = pytest.mark.skipif(
    any(shutil.which(name) is None for name in NEEDED), reason=f"one of {', '.join(NEEDED)} is missing"
)


def make_root(folder: Path) -> Path:
    """What mkroot.sh leaves of a kernel, a loader and a release, nearly empty."""
    modules = folder / "usr/lib/modules" / KERNEL
    files = {
        f"{modules}/vmlinuz": b"kernel",
        f"{modules}/dtb/broadcom/bcm2711-rpi-4-b.dtb": b"pi 4",
        f"{modules}/dtb/broadcom/bcm2712-rpi-5-b.dtb": b"pi 5",
        f"{modules}/dtb/broadcom/bcm2712-d-rpi-5-b.dtb": b"a newer pi 5",
        f"{modules}/modules.order": b"kernel/fs/squashfs/squashfs.ko\n",
        f"{modules}/modules.builtin": b"",
        f"{folder}/usr/lib/raspi-firmware/start4.elf": b"loader",
        f"{folder}/usr/lib/raspi-firmware/fixup4.dat": b"its other half",
        f"{folder}/usr/bin/busybox": b"a shell",
        f"{folder}/opt/bunraku/current/release": b"version 1.0.0\n",
        f"{folder}/etc/bunraku-packages": b"bash 5 1\n",
        f"{folder}/boot/nothing": b"",
    }
    for name, content in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(content)
    (folder / "lib").symlink_to("usr/lib")
    for name in ("fs/squashfs/squashfs", "fs/overlayfs/overlay", "drivers/mmc/host/sdhci-brcmstb"):
        driver = modules / "kernel" / f"{name}.ko"
        driver.parent.mkdir(parents=True)
        shutil.copy(shutil.which("true") or "/bin/true", driver)
    return folder


def make_image(root: Path, out: Path) -> Path:
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    made = [IMAGE / "mkimage.sh", root, out]
    done = subprocess.run(made, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_root(tmp_path_factory.mktemp("root"))


@pytest.fixture(scope="module")
def image(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_image(root, tmp_path_factory.mktemp("image") / "bunraku-arm64.img")


def on_card(image: Path, name: str) -> bytes:
    return subprocess.run(
        ["mtype", "-i", f"{image}{BOOT}", f"::/{name}"], capture_output=True, check=True
    ).stdout


def test_the_card_has_three_partitions_each_with_its_kind_and_name(image: Path) -> None:
    listed = subprocess.run(["sfdisk", "--json", image], capture_output=True, text=True, check=True)
    table = json.loads(listed.stdout)["partitiontable"]
    assert [one["name"] for one in table["partitions"]] == ["bunraku-boot", "bunraku-root", "data"]
    assert [one["start"] * 512 // MIB for one in table["partitions"]] == [2, 256, 768]
    assert table["partitions"][1]["type"].upper() == "B921B045-1DF0-41C3-AF44-4C6F280D3FAE", (
        "a root for arm64"
    )


def test_a_loader_that_knows_only_the_older_table_finds_the_boot_partition(image: Path) -> None:
    first = image.read_bytes()[:512]
    assert first[510:] == b"\x55\xaa"
    entries = [first[446 + 16 * k : 462 + 16 * k] for k in range(4)]
    kinds = [entry[4] for entry in entries]
    assert kinds == [0x0C, 0xEE, 0, 0], "FAT first; all else belongs to the newer table"
    start, size = struct.unpack("<II", entries[0][8:])
    assert (start * 512, size * 512) == (2 * MIB, 254 * MIB)
    guarded_from, guarded = struct.unpack("<II", entries[1][8:])
    assert (guarded_from, guarded_from + guarded) == (1, start), "Linux still takes the newer table"
    assert image.read_bytes()[2 * MIB + 82 : 2 * MIB + 87] == b"FAT32"


def test_every_file_that_config_txt_names_is_on_the_card(image: Path) -> None:
    config = configparser.ConfigParser(strict=False, delimiters=("=",), comment_prefixes=("#",))
    text = on_card(image, "config.txt").decode()
    initramfs = re.search(r"^initramfs (\S+) followkernel$", text, re.MULTILINE)
    assert initramfs is not None
    config.read_string("[all]\n" + text.replace(initramfs[0], ""))
    everywhere = config["all"]
    assert everywhere["arm_64bit"] == "1"
    assert on_card(image, everywhere["kernel"]) == b"kernel"
    assert on_card(image, everywhere["cmdline"])
    assert on_card(image, initramfs[1])
    assert config["pi5"]["usb_max_current_enable"] == "1"
    for name in ("start4.elf", "fixup4.dat", "bcm2711-rpi-4-b.dtb", "bcm2712-rpi-5-b.dtb"):
        assert on_card(image, name)
    assert on_card(image, "bcm2712d0-rpi-5-b.dtb") == b"a newer pi 5", "the name that newer loaders ask for"


def test_the_command_line_names_the_root_and_how_the_machine_behaves(image: Path) -> None:
    lines = on_card(image, "cmdline.txt").decode().splitlines()
    assert len(lines) == 1, "the loader reads one line"
    words = lines[0].split(" ")
    listed = subprocess.run(["sfdisk", "--part-uuid", image, "2"], capture_output=True, text=True, check=True)
    assert f"root=PARTUUID={listed.stdout.strip().lower()}" in words
    for word in ("panic=5", "ro", "cpufreq.default_governor=performance", "systemd.gpt_auto=0"):
        assert word in words


def test_the_start_image_has_the_drivers_in_their_order(image: Path, tmp_path: Path) -> None:
    (tmp_path / "initrd").write_bytes(on_card(image, "initrd"))
    unpacked = tmp_path / "start"
    unpacked.mkdir()
    subprocess.run("zstd -dcq ../initrd | cpio -idm --quiet", shell=True, cwd=unpacked, check=True)
    drivers = (unpacked / "modules").read_text().split()
    assert drivers == ["/drivers/sdhci-brcmstb.ko", "/drivers/squashfs.ko", "/drivers/overlay.ko"]
    assert all((unpacked / name.lstrip("/")).is_file() for name in drivers)
    assert os.access(unpacked / "init", os.X_OK)
    assert "overlay" in (unpacked / "over-the-root").read_text()


def test_the_example_of_the_wifi_is_on_the_card_and_no_loader_is_in_the_root(image: Path) -> None:
    assert on_card(image, "bunraku-wifi.yaml") == (IMAGE / "bunraku-wifi.yaml").read_bytes()
    listed = subprocess.run(
        ["unsquashfs", "-quiet", "-ls", "-offset", str(256 * MIB), image],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "bunraku-packages" in listed.stdout
    assert "vmlinuz" not in listed.stdout
    assert "start4.elf" not in listed.stdout


def test_the_same_root_gives_the_same_bytes(root: Path, image: Path, tmp_path: Path) -> None:
    again = make_image(root, tmp_path / "again.img")
    assert again.read_bytes() == image.read_bytes()


def test_another_release_has_another_root(image: Path, tmp_path: Path) -> None:
    root = make_root(tmp_path / "root")
    (root / "opt/bunraku/current/release").write_text("version 2.0.0\n")
    other = make_image(root, tmp_path / "other.img")
    assert on_card(other, "cmdline.txt") != on_card(image, "cmdline.txt")


def test_a_root_without_a_kernel_is_refused(tmp_path: Path) -> None:
    (tmp_path / "boot").mkdir()
    (tmp_path / "usr/lib/modules").mkdir(parents=True)
    done = subprocess.run(
        [IMAGE / "mkimage.sh", tmp_path, tmp_path / "out.img"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "has no kernel" in done.stderr
    assert not (tmp_path / "out.img").exists()
