"""The sketch says what it is built with, and its pages say the same."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from appliance.sensor import wire

REPOSITORY = Path(__file__).parents[2]
SKETCH = REPOSITORY / "firmware" / "wearable"
PAGE = (REPOSITORY / "docs" / "firmware.md").read_text()


def pinned() -> tuple[str, str, str]:
    """Board, core and Wi-Fi library of the build profile."""
    profile = yaml.safe_load((SKETCH / "sketch.yaml").read_text())["profiles"]["mkr1000"]
    [platform], [library] = profile["platforms"], profile["libraries"]
    return profile["fqbn"], platform["platform"], library


def test_the_profile_pins_board_core_and_library() -> None:
    assert pinned() == ("arduino:samd:mkr1000", "arduino:samd (1.8.14)", "WiFi101 (0.16.1)")


def test_stubs_and_page_are_of_the_pinned_versions() -> None:
    core, library = (re.findall(r"\((.+)\)", version)[0] for version in pinned()[1:])
    for text in (PAGE, (REPOSITORY / "firmware" / "stubs" / "README.md").read_text()):
        assert f"SAMD core {core}" in text
        assert f"WiFi101 {library}" in text


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
