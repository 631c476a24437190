"""Fixtures as the Open Fixture Library writes them become profiles that the box reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from appliance.cli.app import command_line
from appliance.fixture_library.open_fixture_library import LibraryError, profile_values
from appliance.lights.patch import Patch
from appliance.show.fixture_profile import load_profile
from appliance.show.lights import LightsConfig, drivable
from tests.command import Command

MOVER: dict[str, Any] = {
    "name": "Testbeam 1",
    "physical": {"focus": {"panMax": 540, "tiltMax": 270}},
    "wheels": {"Gobo Wheel": {"slots": [{"type": "Open"}, {"type": "Gobo"}]}},
    "availableChannels": {
        "Pan": {
            "fineChannelAliases": ["Pan fine"],
            "defaultValue": 32768,
            "capability": {"type": "Pan", "angleStart": "0deg", "angleEnd": "430deg"},
        },
        "Tilt": {
            "fineChannelAliases": ["Tilt fine"],
            "capability": {"type": "Tilt", "angleStart": "100%", "angleEnd": "0%"},
        },
        "Dimmer / Strobe": {
            "capabilities": [
                {"dmxRange": [0, 7], "type": "ShutterStrobe", "shutterEffect": "Closed"},
                {"dmxRange": [8, 134], "type": "Intensity"},
                {"dmxRange": [135, 239], "type": "ShutterStrobe", "shutterEffect": "Strobe"},
                {"dmxRange": [240, 255], "type": "ShutterStrobe", "shutterEffect": "Open"},
            ]
        },
        "Shutter": {
            "capabilities": [
                {"dmxRange": [0, 31], "type": "ShutterStrobe", "shutterEffect": "Closed"},
                {"dmxRange": [32, 63], "type": "ShutterStrobe", "shutterEffect": "Open"},
                {"dmxRange": [64, 255], "type": "ShutterStrobe", "shutterEffect": "Strobe"},
            ]
        },
        "Red": {"capability": {"type": "ColorIntensity", "color": "Red"}},
        "Zoom": {
            "fineChannelAliases": ["Zoom fine"],
            "dmxValueResolution": "8bit",
            "defaultValue": 51,
            "capability": {"type": "Zoom", "angleStart": "5deg", "angleEnd": "50deg"},
        },
        "Gobo Wheel": {
            "capabilities": [
                {"dmxRange": [0, 127], "type": "WheelSlot", "slotNumber": 1},
                {"dmxRange": [128, 255], "type": "WheelSlot", "slotNumber": 2},
            ]
        },
        "Reserved": {"capability": {"type": "NoFunction"}},
        "Mode": {
            "defaultValue": 0,
            "capabilities": [
                {"dmxRange": [0, 99], "type": "Generic", "switchChannels": {"Speed / Sound": "Speed"}},
                {"dmxRange": [100, 255], "type": "Generic", "switchChannels": {"Speed / Sound": "Sound"}},
            ],
        },
        "Speed": {"capability": {"type": "Speed", "speedStart": "slow", "speedEnd": "fast"}},
        "Sound": {"capability": {"type": "SoundSensitivity"}},
    },
    "modes": [
        {
            "name": "Full",
            "shortName": "15ch",
            "channels": [
                *("Pan", "Pan fine", "Tilt", "Tilt fine", "Dimmer / Strobe", "Shutter", "Red"),
                *("Zoom", "Zoom fine", "Gobo Wheel", "Reserved", None, "Mode", "Speed / Sound"),
            ],
        },
        {"name": "Small", "channels": ["Pan", "Tilt", "Dimmer / Strobe"]},
    ],
}
BAR: dict[str, Any] = {
    "name": "Bar",
    "matrix": {"pixelCount": [12, 1, 1], "pixelGroups": {"Left": ["1", "2"], "Right": {"x": [">=11"]}}},
    "availableChannels": {"Dimmer": {"capability": {"type": "Intensity"}}},
    "templateChannels": {
        "Red $pixelKey": {
            "fineChannelAliases": ["Red $pixelKey fine"],
            "capability": {"type": "ColorIntensity", "color": "Red"},
        },
        "Dimmer $pixelKey": {"capability": {"type": "Intensity"}},
    },
    "modes": [
        {
            "name": "pixels",
            "channels": [
                "Dimmer",
                {
                    "insert": "matrixChannels",
                    "repeatFor": "eachPixelABC",
                    "channelOrder": "perPixel",
                    "templateChannels": ["Red $pixelKey", "Red $pixelKey fine", "Dimmer $pixelKey"],
                },
            ],
        },
        {
            "name": "groups",
            "channels": [
                {
                    "insert": "matrixChannels",
                    "repeatFor": "eachPixelGroup",
                    "channelOrder": "perChannel",
                    "templateChannels": ["Red $pixelKey", None, "Dimmer $pixelKey"],
                }
            ],
        },
        {"name": "one", "channels": ["Dimmer Left", "Red Left"]},
    ],
}


def converted(fixture: dict[str, Any], folder: Path) -> Any:
    """By the command itself, as a show uses it."""
    (folder / "profiles").mkdir(exist_ok=True)
    source = folder / "fixture.json"
    source.write_text(json.dumps(fixture))
    out = folder / "profiles" / "converted.yaml"
    result = CliRunner().invoke(command_line(), ["lights", "convert", str(source), "--out", str(out)])
    assert result.exit_code == 0, result.output
    return load_profile("converted", folder), result.output


def test_a_moving_head_keeps_its_channels_ranges_and_rest(tmp_path: Path) -> None:
    profile, said = converted(MOVER, tmp_path)
    assert profile.name == "Testbeam 1"
    assert profile.mode("15ch").channels == [
        *("pan", "pan fine", "tilt", "tilt fine", "dimmer", "shutter", "red", "zoom", "zoom fine"),
        *("gobo wheel", "-", "-", "mode", "speed"),
    ]
    assert profile.mode("Small").channels == ["pan", "tilt", "dimmer"]
    assert profile.attribute("pan").degrees == 430
    assert profile.attribute("tilt").degrees == 270  # in percent there; the physical data know it
    assert profile.attribute("dimmer").limits == (8, 134)
    assert 32 <= profile.attribute("shutter").default * 255 <= 63
    assert profile.attribute("zoom").default == pytest.approx(0.2)
    assert profile.attribute("gobo wheel").snap and not profile.attribute("zoom").snap
    assert "'Speed / Sound' depends on 'Mode': it is taken as 'Speed'" in said


def test_it_can_be_patched_and_driven(tmp_path: Path) -> None:
    converted(MOVER, tmp_path)
    values = {"fixtures": [{"name": "x", "profile": "converted", "mode": "15ch", "address": 5}]}
    config = LightsConfig.model_validate(values, context={"directory": tmp_path})
    assert {"aim", "colour", "dimmer", "zoom", "gobo wheel"} <= set(drivable(config.fixtures[0], tmp_path))
    patch = Patch(config.fixtures, tmp_path)
    values = patch.defaults.copy()
    values[patch.select(["x"], "dimmer")] = 1.0
    levels = patch.encode(values)[1]
    assert levels[8] == 134
    assert 32 <= levels[9] <= 63


def test_pixels_are_numbered_as_people_count_and_stand_under_one_dimmer(tmp_path: Path) -> None:
    profile, _ = converted(BAR, tmp_path)
    pixels = profile.mode("pixels").channels
    assert pixels[:7] == ["dimmer", "red 1", "red 1 fine", "dimmer 1", "red 2", "red 2 fine", "dimmer 2"]
    assert pixels[-3:] == ["red 12", "red 12 fine", "dimmer 12"]
    assert profile.mode("groups").channels == ["red 1", "red 2", "-", "-", "dimmer 1", "dimmer 2"]
    assert profile.mode("one").attributes == ("dimmer 1", "red 1")


@pytest.mark.parametrize(
    ("repeat_for", "wanted"),
    [
        ("eachPixelXYZ", ["(1, 1)", "(2, 1)", "(1, 2)", "(2, 2)"]),
        ("eachPixelYXZ", ["(1, 1)", "(1, 2)", "(2, 1)", "(2, 2)"]),
        (["(2, 2)", "(1, 1)"], ["(2, 2)", "(1, 1)"]),
    ],
)
def test_matrices_are_read_in_the_order_that_they_ask_for(repeat_for: Any, wanted: list[str]) -> None:
    block = {
        "insert": "matrixChannels",
        "repeatFor": repeat_for,
        "channelOrder": "perPixel",
        "templateChannels": ["Macro $pixelKey"],
    }
    fixture = {
        "name": "Grid",
        "matrix": {"pixelCount": [2, 2, 1]},
        "templateChannels": {"Macro $pixelKey": {"capability": {"type": "Effect", "effectName": "x"}}},
        "modes": [{"name": "m", "channels": [block]}],
    }
    values, _ = profile_values(fixture)
    assert values["modes"][0]["channels"] == [f"macro {pixel}" for pixel in wanted]


def test_modes_larger_than_a_universe_are_left_out_and_reported() -> None:
    fixture = {
        **BAR,
        "matrix": {"pixelCount": [300, 1, 1]},
        "modes": [
            {"name": "huge", "channels": [{**BAR["modes"][0]["channels"][1]}]},
            {"name": "one", "channels": ["Dimmer"]},
        ],
    }
    values, notes = profile_values(fixture)
    assert [mode["name"] for mode in values["modes"]] == ["one"]
    assert any("'huge' has 900 channels" in note for note in notes)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"redirectTo": "maker/other"}', "now called maker/other"),
        ("{}", "not a fixture of the Open Fixture Library"),
        ('{"name": "x", "modes": [{"name": "m", "channels": ["Nowhere"]}]}', "Nowhere"),
        ("[1, 2]", "not a fixture"),
        ("{", "not JSON"),
    ],
)
def test_other_files_are_refused_in_words_and_nothing_is_written(
    tmp_path: Path, content: str, message: str, bunraku: Command
) -> None:

    source = tmp_path / "x.json"
    source.write_text(content)
    assert message in bunraku("lights", "convert", source, status=2).err
    assert [path.name for path in tmp_path.iterdir()] == ["x.json"]


def test_a_fixture_larger_than_a_universe_in_all_modes_is_refused() -> None:
    huge = {**BAR, "matrix": {"pixelCount": [300, 1, 1]}, "modes": [BAR["modes"][0]]}
    with pytest.raises(LibraryError, match="No mode of Bar fits"):
        profile_values(huge)


def test_a_library_error_is_what_the_converter_raises() -> None:
    with pytest.raises(LibraryError):
        profile_values({"name": 3})


def test_a_dimmer_that_glows_at_the_start_of_its_range_is_off_at_nothing() -> None:
    """As strobes write it: 0 to 5 off, 6 to 255 from dark to bright. Blackout has to mean off."""
    dimmer = {
        "capabilities": [
            {"dmxRange": [0, 5], "type": "Intensity", "brightness": "off"},
            {"dmxRange": [6, 255], "type": "Intensity", "brightnessStart": "dark", "brightnessEnd": "bright"},
        ]
    }
    strobe = {"name": "S", "availableChannels": {"D": dimmer}, "modes": [{"name": "1", "channels": ["D"]}]}
    assert profile_values(strobe)[0]["attributes"] == []
