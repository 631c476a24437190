"""Fixtures in GDTF become profiles that the box reads; hostile files are refused in one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from appliance.lights.patch import Patch
from appliance.show.fixture_profile import ProfileConfig, load_profile
from appliance.show.lights import LightsConfig
from tests.command import Command
from tests.fixture_library.gdtf_files import (
    EIGHT_BIT,
    SIXTEEN_BIT,
    archive,
    channel,
    fixture,
    function,
    moving_head,
    write_gdtf,
)


def converted(description: str, folder: Path, bunraku: Command, *options: str) -> tuple[ProfileConfig, str]:
    """By the command itself, as a show uses it."""
    source = write_gdtf(folder / "fixture.gdtf", description)
    out = folder / "profiles" / "converted.yaml"
    said = bunraku("lights", "convert", source, "--out", out, *options).out
    return load_profile("converted", folder), said


def test_a_moving_head_keeps_its_channels_ranges_and_rest(tmp_path: Path, bunraku: Command) -> None:
    profile, _ = converted(moving_head(), tmp_path, bunraku)
    assert profile.name == "Testlight Beam 1"
    assert profile.mode(SIXTEEN_BIT).channels == [
        *("pan", "pan fine", "tilt", "tilt fine", "dimmer", "shutter", "red", "green", "blue", "-"),
        "gobo wheel",
    ]
    assert profile.mode(EIGHT_BIT).channels == ["pan", "tilt", "dimmer"]
    assert (profile.attribute("pan").degrees, profile.attribute("tilt").degrees) == (540, 270)
    assert not profile.attribute("pan").invert and not profile.attribute("tilt").invert
    assert 32 <= (profile.attribute("shutter").default or 0) * 255 <= 63
    assert profile.attribute("gobo wheel").snap
    assert (profile.attribute("pan").slew, profile.attribute("tilt").slew) == (216, None)  # 540 in 2.5 s

    values = {"fixtures": [{"name": "x", "profile": "converted", "mode": SIXTEEN_BIT, "address": 5}]}
    config = LightsConfig.model_validate(values, context={"directory": tmp_path})
    levels = Patch(config.fixtures, tmp_path)
    sent = levels.encode(levels.defaults)[1]
    assert 32 <= sent[9] <= 63  # open
    assert list(sent[4:8]) == [128, 0, 128, 0]  # pan and tilt in the middle


def test_a_head_that_pans_the_other_way_is_inverted(tmp_path: Path, bunraku: Command) -> None:
    profile, _ = converted(moving_head(pan=(-270, 270), tilt=(135, -135)), tmp_path, bunraku)
    assert profile.attribute("pan").invert and profile.attribute("tilt").invert


def test_a_shutter_without_named_parts_is_taken_as_open(tmp_path: Path, bunraku: Command) -> None:
    functions = function("Shutter1") + function("Shutter1Strobe", (1, 20), "100/1")
    inside = channel("1", "Beam", functions, "Shutter1")
    mode = f'<DMXMode Name="m" Geometry="Base"><DMXChannels>{inside}</DMXChannels></DMXMode>'
    profile, _ = converted(fixture(mode), tmp_path, bunraku)
    assert 0 < (profile.attribute("shutter").default or 0) * 255 < 100


def test_a_range_that_is_not_even_about_zero_is_reported(tmp_path: Path, bunraku: Command) -> None:
    _, said = converted(moving_head(tilt=(-90, 130)), tmp_path, bunraku)
    assert "Tilt is 20 degrees in the middle of its range" in said


def test_one_mode_can_be_chosen_and_a_missing_one_is_named(tmp_path: Path, bunraku: Command) -> None:
    profile, _ = converted(moving_head(), tmp_path, bunraku, "--mode", EIGHT_BIT)
    assert [mode.name for mode in profile.modes] == [EIGHT_BIT]
    refused = bunraku("lights", "convert", tmp_path / "fixture.gdtf", "--mode", "Nine", status=2).err
    assert "no mode 'Nine'" in refused and SIXTEEN_BIT in refused and EIGHT_BIT in refused


def test_modes_that_one_profile_cannot_hold_are_told_apart(tmp_path: Path, bunraku: Command) -> None:
    modes = "".join(
        f'<DMXMode Name="{name}" Geometry="Base"><DMXChannels>'
        + channel("1", "Yoke", function("Pan", physical), "Pan")
        + "</DMXChannels></DMXMode>"
        for name, physical in (("wide", (270, -270)), ("narrow", (90, -90)))
    )
    profile, said = converted(fixture(modes), tmp_path, bunraku)
    assert [mode.name for mode in profile.modes] == ["wide"]
    assert "'narrow' uses 'pan' in another way" in said
    profile, _ = converted(fixture(modes), tmp_path, bunraku, "--mode", "narrow")
    assert profile.attribute("pan").degrees == 180


def test_repeated_cells_are_numbered_under_one_dimmer(tmp_path: Path, bunraku: Command) -> None:
    cells = "".join(
        f'<GeometryReference Name="Cell {cell}" Geometry="Cell"><Break DMXOffset="{2 * cell}" DMXBreak="1"/>'
        "</GeometryReference>"
        for cell in (1, 2, 3)
    )
    parts = f'<Geometry Name="Bar">{cells}</Geometry><Beam Name="Cell"/>'
    inside = (
        channel("1", "Bar", function("Dimmer"), "Dimmer")
        + channel("1", "Cell", function("ColorAdd_R"), "ColorAdd_R").replace('"1" Off', '"Overwrite" Off')
        + channel("2", "Cell", function("Dimmer"), "Dimmer").replace('"1" Off', '"Overwrite" Off')
    )
    mode = f'<DMXMode Name="cells" Geometry="Bar"><DMXChannels>{inside}</DMXChannels></DMXMode>'
    profile, _ = converted(fixture(mode, parts), tmp_path, bunraku)
    assert profile.modes[0].channels == [
        "dimmer",
        *("red 1", "dimmer 1", "red 2", "dimmer 2", "red 3", "dimmer 3"),
    ]


def test_of_functions_that_another_channel_chooses_the_default_one_counts(
    tmp_path: Path, bunraku: Command
) -> None:
    chosen = function("Zoom", more='ModeMaster="Beam_Control1" ModeFrom="0/1" ModeTo="99/1"') + function(
        "Prism1", more='ModeMaster="Beam_Control1" ModeFrom="100/1" ModeTo="255/1"'
    )
    inside = channel("1", "Beam", function("Control1"), "Control1") + channel("2", "Beam", chosen, "Zoom")
    mode = f'<DMXMode Name="m" Geometry="Base"><DMXChannels>{inside}</DMXChannels></DMXMode>'
    profile, said = converted(fixture(mode), tmp_path, bunraku)
    assert profile.modes[0].channels == ["control", "zoom"]
    assert not profile.attribute("zoom").snap
    assert "'zoom' depends on another channel" in said


DEEP = "<a>" * 2000 + "</a>" * 2000
LAUGHS = '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><a>&b;</a>'
FAR = fixture(
    '<DMXMode Name="m" Geometry="Base"><DMXChannels>'
    + channel("1000000000", "Beam", function("Dimmer"), "Dimmer")
    + "</DMXChannels></DMXMode>"
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no archive", "not a zip archive"),
        (archive({"other.xml": "<a/>"}), "no 'description.xml'"),
        (archive({"description.xml": " " * 20_000_000}), "larger than 16 MB"),
        (archive({"description.xml": moving_head(), "../../escaped": "x"}), "outside itself"),
        (archive({f"{number}": "" for number in range(10_001)}), "more than 10000 files"),
        (archive({"description.xml": LAUGHS}), "defines entities"),
        (archive({"description.xml": DEEP}), "nested too deeply"),
        (archive({"description.xml": "<GDTF>"}), "not XML"),
        (archive({"description.xml": b"\xff\xfe<"}), "not UTF-8"),
        (archive({"description.xml": "<GDTF/>"}), "no FixtureType"),
        (archive({"description.xml": FAR}), "'Offset' is '1000000000'"),
        (archive({"description.xml": fixture("")}), "no channels"),
        (archive({"description.xml": moving_head()})[:-400], "not a zip archive"),
    ],
)
def test_hostile_and_broken_files_get_one_sentence_and_nothing_is_written(
    tmp_path: Path, content: bytes, message: str, bunraku: Command
) -> None:
    source = tmp_path / "x.gdtf"
    source.write_bytes(content)
    said = bunraku("lights", "convert", source, status=2).err
    assert message in " ".join(said.split())
    assert [path.name for path in tmp_path.iterdir()] == ["x.gdtf"]


def test_without_the_libraries_it_says_what_to_install(
    tmp_path: Path, bunraku: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pygdtf", None)
    source = write_gdtf(tmp_path / "x.gdtf", moving_head())
    assert "bunraku[gdtf]" in bunraku("lights", "convert", source, status=2).err
