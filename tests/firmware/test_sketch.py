"""The sketch says what it is built with, and its pages say the same."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from appliance.sensor import wire

REPOSITORY = Path(__file__).parents[2]
SKETCH = REPOSITORY / "firmware" / "wearable"
PAGE = (REPOSITORY / "docs" / "firmware.md").read_text()


PROFILES = yaml.safe_load((SKETCH / "sketch.yaml").read_text())["profiles"]
BOARDS = {
    "mkr1000": ("arduino:samd:mkr1000", "SAMD core 1.8.14", "WiFi101 0.16.1"),
    "mkrwifi1010": ("arduino:samd:mkrwifi1010", "SAMD core 1.8.14", "WiFiNINA 1.9.1"),
    "xiao_esp32s3": ("esp32:esp32:XIAO_ESP32S3", "esp32 core 3.3.3"),
    "nano_esp32": ("esp32:esp32:nano_nora", "esp32 core 3.3.3"),
}


def version_of(text: str) -> str:
    [version] = re.findall(r"\((.+)\)", text)
    return str(version)


@pytest.mark.parametrize("profile", BOARDS)
def test_each_profile_stubs_and_page_name_the_same_versions(profile: str) -> None:
    board, *parts = BOARDS[profile]
    pinned = PROFILES[profile]
    assert pinned["fqbn"] == board
    [platform] = pinned["platforms"]
    versions = [version_of(one) for one in (platform["platform"], *pinned.get("libraries", []))]
    assert versions == [part.rsplit(" ", 1)[1] for part in parts]
    for text in (PAGE, (REPOSITORY / "firmware" / "stubs" / "README.md").read_text()):
        assert all(part in " ".join(text.split()) for part in parts)


def test_every_profile_is_built_and_every_board_of_the_sketch_has_one() -> None:
    assert set(BOARDS) == set(PROFILES)
    built = re.search(r"^PROFILES \?= (.+)$", (REPOSITORY / "Makefile").read_text(), re.MULTILINE)
    assert built is not None
    assert set(built[1].split()) == set(PROFILES)
    known = re.findall(r"defined\(ARDUINO_(\w+)\)", (SKETCH / "src" / "arduino" / "board.h").read_text())
    checked = re.findall(
        r"^add_sketch\((\w+)",
        (REPOSITORY / "firmware/cmake/on-the-processor.cmake").read_text(),
        re.MULTILINE,
    )
    assert sorted(known) == sorted(checked)
    assert len(known) == len(PROFILES)


def test_images_that_cannot_all_be_built_are_refused_before_the_first(tmp_path: Path) -> None:
    (tmp_path / "firmware" / "wearable").mkdir(parents=True)
    (tmp_path / "firmware" / "wearable" / "sketch.yaml").touch()
    compiler = tmp_path / "arduino-cli"
    compiler.write_text("#!/bin/sh\ntouch compiled\n")
    compiler.chmod(0o755)
    command = ["make", "--file", str(REPOSITORY / "Makefile"), "firmware-bin", "PROFILES=mkr1000 nano_esp32"]
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(command, cwd=tmp_path, env=path, capture_output=True, text=True, check=False)
    assert done.returncode and "need ESP32_INDEX, the address" in done.stderr
    assert not (tmp_path / "compiled").exists()


def test_the_firmware_speaks_this_wire_under_one_version_number() -> None:
    header = (SKETCH / "src" / "core" / "wire.h").read_text()
    assert f"kWireHash = 0x{wire.WIRE_HASH:08x}u" in header
    version = (SKETCH / "src" / "core" / "version.h").read_text()
    numbers = re.findall(r"kFirmware(?:Major|Minor|Patch) = (\d+)", version)
    assert f'kFirmwareVersion[] = "{".".join(numbers)}"' in version


def test_the_core_knows_no_arduino() -> None:
    allowed = {"stdint.h", "stddef.h", "string.h"}
    for source in (SKETCH / "src" / "core").iterdir():
        included = re.findall(r'^#include [<"](.+?)[>"]', source.read_text(), re.MULTILINE)
        outside = {name for name in included if not (source.parent / name).exists()} - allowed
        assert not outside, f"{source.name}: {outside}"
