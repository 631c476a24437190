"""Fixtures in GDTF become profiles that the box reads; hostile files are refused in one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.lights.head import heads_of
from appliance.lights.patch import Patch
from appliance.show.fixture_profile import ProfileConfig, load_profile
from appliance.show.lights import LightsConfig
from tests.command import Command
from tests.fixture_library.gdtf_files import (
    EIGHT_BIT,
    IDENTITY,
    SIXTEEN_BIT,
    archive,
    channel,
    fixture,
    function,
    hung,
    moving_head,
    scene,
    write_gdtf,
    write_mvr,
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


FLOOR = "{1,0,0}{0,-1,0}{0,0,-1}"  # turned about x by half a turn: on its base, drawn front to the back
TRUSS = (
    '<Truss name="bar" uuid="2"><Matrix>{0,1,0}{-1,0,0}{0,0,1}{0,0,3000}</Matrix>'
    "<ChildList>%s</ChildList></Truss>"
)


def rig_in(folder: Path, children: str, bunraku: Command) -> tuple[LightsConfig, str]:
    """The list that the command wrote, as a show reads it."""
    said = bunraku("lights", "convert", write_mvr(folder / "rig.mvr", children)).out
    values = yaml.safe_load((folder / "rig" / "rig.yaml").read_text())
    return LightsConfig.model_validate(values, context={"directory": folder / "rig"}), said


def test_a_rig_of_two_keeps_patch_place_and_direction(tmp_path: Path, bunraku: Command) -> None:
    on_the_bar = TRUSS % hung("Beam", "600", IDENTITY + "{2000,0,0}")
    config, _ = rig_in(
        tmp_path, on_the_bar + hung("Beam", "1.1", FLOOR + "{-1500,-2000,-1000}", EIGHT_BIT), bunraku
    )
    floor, bar = sorted(config.fixtures, key=lambda one: one.universe)
    assert {floor.name, bar.name} == {"Beam", "Beam 2"}
    assert (floor.universe, floor.address, floor.mode) == (1, 1, EIGHT_BIT)
    assert (bar.universe, bar.address) == (2, 88)
    # MVR has y upstage and millimetres: 2 m towards the audience is z = 2 here
    assert (floor.place, floor.pose) == ((-1.5, 0.0, 2.0), "standing")
    assert (bar.place, bar.pose) == ((0.0, 4.0, -2.0), "hanging")

    patch = Patch(config.fixtures, tmp_path / "rig")
    heads = heads_of(patch.slots)
    for place, lamp in enumerate(config.fixtures):
        down = -1.0 if lamp.pose == "hanging" else 1.0
        assert heads.beams()[place] == pytest.approx([0.0, down, 0.0], abs=1e-6)
    # Tilted by 30 degrees right-handed about the drawn x axis, and panned by 90 about the drawn z axis:
    # GDTF's own rotations, through the rows of the matrices above.
    heads.angles[heads.tilts] = 30.0
    heads.angles[heads.pans] = -90.0  # the profile's pan has the other sign
    own = _about_z(90.0) @ _about_x(30.0) @ [0.0, 0.0, -1.0]
    rows = {"hanging": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "standing": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}
    for place, lamp in enumerate(config.fixtures):
        x, y, z = np.array(rows[lamp.pose], float).T @ own
        assert heads.beams()[place] == pytest.approx([x, z, -y], abs=1e-3)


def _about_x(degrees: float) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def _about_z(degrees: float) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


@pytest.mark.parametrize("angles", [(20.0, 30.0, 40.0), (-100.0, 90.0, 10.0), (170.0, -75.0, 200.0)])
def test_any_turn_is_kept(tmp_path: Path, bunraku: Command, angles: tuple[float, float, float]) -> None:
    rotation = _about_z(angles[0]) @ _about_x(angles[1]) @ _about_z(angles[2])
    matrix = "".join(
        "{" + ",".join(f"{part:.9f}" for part in row) + "}" for row in (*rotation.T, np.zeros(3))
    )
    config, _ = rig_in(tmp_path, hung("Beam", "1", matrix), bunraku)
    heads = heads_of(Patch(config.fixtures, tmp_path / "rig").slots)
    heads.angles[heads.tilts], heads.angles[heads.pans] = 50.0, -20.0
    x, y, z = rotation @ _about_z(20.0) @ _about_x(50.0) @ [0.0, 0.0, -1.0]
    assert heads.beams()[0] == pytest.approx([x, z, -y], abs=1e-3)


def test_faults_of_a_rig_are_named_and_the_rest_is_written(tmp_path: Path, bunraku: Command) -> None:
    here = IDENTITY + "{0,0,0}"
    children = (
        hung("good", "1", here)
        + hung("no mode", "30", here, mode="Nine")
        + hung("no file", "60", here, spec="../../elsewhere")
        + hung("no place", "90", "{0,0,0}{0,0,0}{0,0,0}{0,0,0}")
        + hung("unpatched", "120", here)
        .replace("<Addresses>", "<Nothing>")
        .replace("</Addresses>", "</Nothing>")
    )
    config, said = rig_in(tmp_path, children, bunraku)
    assert [fixture.name for fixture in config.fixtures] == ["good"]
    assert "no mode 'Nine'" in said and "no GDTF file '../../elsewhere.gdtf'" in said
    for name in ("no mode", "no file", "no place", "unpatched"):
        assert f"'{name}' " in said


def test_fixtures_on_the_same_channels_are_written_and_named(tmp_path: Path, bunraku: Command) -> None:
    here = IDENTITY + "{0,0,0}"
    source = write_mvr(tmp_path / "rig.mvr", hung("a", "1", here) + hung("b", "5", here))
    said = bunraku("lights", "convert", source).out
    assert "A show refuses this list" in said and "'a' and 'b' are both on channel 5" in said


NESTED = "".join(f'<Truss name="{depth}" uuid="3"><ChildList>' for depth in range(40))
NESTED += "</ChildList></Truss>" * 40


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"description.xml": "<GDTF/>"}, "not an MVR file"),
        ({"GeneralSceneDescription.xml": "<a>"}, "not XML"),
        ({"GeneralSceneDescription.xml": "<GeneralSceneDescription/>"}, "not a rig in MVR"),
        ({"GeneralSceneDescription.xml": scene("")}, "no fixture"),
        ({"GeneralSceneDescription.xml": scene(NESTED)}, "nested too deeply"),
        ({"GeneralSceneDescription.xml": scene(hung("a", "x", "1"))}, "not a rig in MVR"),
    ],
)
def test_broken_rigs_get_one_sentence_and_nothing_is_written(
    tmp_path: Path, files: dict[str, bytes | str], message: str, bunraku: Command
) -> None:
    source = tmp_path / "x.mvr"
    source.write_bytes(archive(files))
    assert message in " ".join(bunraku("lights", "convert", source, status=2).err.split())
    assert [path.name for path in tmp_path.iterdir()] == ["x.mvr"]
