"""A rig in MVR becomes fixtures of a show, hung and turned as it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.lights.head import heads_of
from appliance.lights.patch import Patch
from appliance.show.lights import LightsConfig
from tests.command import Command
from tests.fixture_library.gdtf_files import EIGHT_BIT, IDENTITY, archive, hung, scene, write_mvr

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
    for place, fixture in enumerate(config.fixtures):
        down = -1.0 if fixture.pose == "hanging" else 1.0
        assert heads.beams()[place] == pytest.approx([0.0, down, 0.0], abs=1e-6)
    # Tilted by 30 degrees right-handed about the drawn x axis, and panned by 90 about the drawn z axis:
    # GDTF's own rotations, through the rows of the matrices above.
    heads.angles[heads.tilts] = 30.0
    heads.angles[heads.pans] = -90.0  # the profile's pan has the other sign
    own = _about_z(90.0) @ _about_x(30.0) @ [0.0, 0.0, -1.0]
    rows = {"hanging": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "standing": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}
    for place, fixture in enumerate(config.fixtures):
        x, y, z = np.array(rows[fixture.pose], float).T @ own
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
