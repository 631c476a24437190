"""glTF of other programs: matrices, scales, mirrors, several skins, animations and root bones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_file import GlbBuffer
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.exchange.glb_reading import Choice, read_glb
from appliance.studio.exchange.reading import read_as_given
from tests.command import Command

TURNS = np.array([[0, 0, 0, 1], [0, 0, 0.6, 0.8], [0.36, 0.48, 0, 0.8]])  # x, y, z, w at 0, 0.5 and 1 s
FIGURE: list[dict[str, Any]] = [
    {"name": "Armature", "children": [1]},
    {"name": "Hips", "translation": [0, 1, 0], "children": [2, 4]},
    {"name": "Chest", "translation": [0, 0.4, 0], "rotation": [0, 0, 0.28, 0.96], "children": [3]},
    {"name": "Head", "translation": [0.05, 0.3, 0]},
    {"name": "LeftLeg", "translation": [0.1, -0.4, 0]},
]


def glb(
    path: Path,
    nodes: Sequence[dict[str, Any]],
    skins: Sequence[dict[str, Any]] = ({"joints": [1, 2, 3, 4]},),
    animations: Sequence[tuple[str, float, Sequence[int]]] = (("Dance", 1.0, (1, 2)),),
    turns: Array = TURNS,
) -> Path:
    """A file in which each animation (name, seconds, nodes) turns its nodes."""
    buffer, written = GlbBuffer(), []
    for name, seconds, moved in animations:
        keys = turns if seconds else turns[:1]
        times = buffer.add(np.linspace(0.0, seconds, len(keys)).astype(np.float32), bounds=True)
        output = buffer.add(keys.astype(np.float32))
        channels = [{"sampler": 0, "target": {"node": node, "path": "rotation"}} for node in moved]
        written.append({"name": name, "samplers": [{"input": times, "output": output}], "channels": channels})
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "nodes": list(nodes), "animations": written}
    buffer.write(path, document | ({"skins": list(skins)} if skins else {}))
    return path


def matrix_of(node: dict[str, Any], turn: Array | None = None) -> Array:
    """(4, 4): a node's own transform, as glTF defines it."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    whole = np.eye(4)
    xyzw = np.array(node.get("rotation", (0, 0, 0, 1)), float) if turn is None else turn
    whole[:3, :3] = quaternion.to_matrix(np.roll(xyzw, 1)) * np.array(node.get("scale", (1, 1, 1)), float)
    whole[:3, 3] = node.get("translation", (0, 0, 0))
    return whole


def places_of(nodes: Sequence[dict[str, Any]], joints: Sequence[int], moved: Sequence[int]) -> Array:
    """(3, J, 3): where the joints are at the three keys, by multiplying matrices."""
    above = {child: node for node, one in enumerate(nodes) for child in one.get("children", [])}
    places = np.empty((3, len(joints), 3))
    for key in range(3):
        for row, joint in enumerate(joints):
            whole, node = np.eye(4), joint
            while node >= 0:
                whole = matrix_of(nodes[node], TURNS[key] if node in moved else None) @ whole
                node = above.get(node, -1)
            places[key, row] = whole[:3, 3]
    return places


def as_matrix(node: dict[str, Any]) -> dict[str, Any]:
    """The same node with a matrix."""
    rest = {key: value for key, value in node.items() if key in ("name", "children")}
    return rest | {"matrix": matrix_of(node).T.ravel().tolist()}


def changed(**by_name: dict[str, Any]) -> list[dict[str, Any]]:
    return [node | by_name.get(node["name"], {}) for node in FIGURE]


Z_UP_CM = {"rotation": [-(0.5**0.5), 0, 0, 0.5**0.5], "scale": [0.01] * 3, "translation": [0.3, 0, 0]}
NODES = {
    "a matrix above": [as_matrix(changed(Armature=Z_UP_CM)[0]), *FIGURE[1:]],
    "a matrix of a still joint": [*FIGURE[:3], as_matrix(FIGURE[3]), as_matrix(FIGURE[4])],
    "a mirror above": changed(Armature={"scale": [-1, 1, 1]}),
    "a mirror in a matrix": [as_matrix(changed(Armature={"scale": [1, 1, -2]})[0]), *FIGURE[1:]],
    "a scaled joint": changed(Chest={"scale": [1.2, 1.2, 1.2]}),
    "a joint scaled along one axis": changed(Hips={"scale": [1, 1.5, 1]}),
    "a mirrored joint": changed(Chest={"scale": [-1, 1, 1]}),
}


@pytest.mark.parametrize("kind", NODES)
def test_joints_are_where_all_nodes_above_put_them(kind: str, tmp_path: Path) -> None:
    found = read_glb(glb(tmp_path / "foreign.glb", NODES[kind]))
    assert found.skeleton.names == ("Hips", "Chest", "Head", "LeftLeg")
    assert ("mirrors the figure" in "".join(found.notes)) == (
        kind in ("a mirror above", "a mirror in a matrix")
    )
    positions, _ = found.skeleton.forward_kinematics(found.poses, found.roots, found.translations)
    np.testing.assert_allclose(positions, places_of(NODES[kind], [1, 2, 3, 4], [1, 2]), atol=1e-6)
    assert np.abs(np.linalg.norm(found.poses, axis=-1) - 1.0).max() < 1e-9


def test_a_joint_that_is_scaled_to_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExchangeError, match="'Chest' is scaled to nothing"):
        read_glb(glb(tmp_path / "flat.glb", changed(Chest={"scale": [0, 0, 0]})))


def test_keys_that_are_no_numbers_are_lost_and_named(tmp_path: Path) -> None:
    turns = np.tile(TURNS[1:2], (9, 1))
    turns[4], turns[6] = np.nan, 0.0
    found = read_glb(glb(tmp_path / "hole.glb", FIGURE, turns=turns))
    np.testing.assert_allclose(found.poses, np.tile(found.poses[:1], (9, 1, 1)), atol=1e-6)
    assert found.notes[0].startswith("rotation of 'Hips': 2 keys of 9 lost")


ALL = ("Hips", "Chest", "Head", "LeftLeg")
HAT = {"name": "Hat", "translation": [1, 1, 1]}


@pytest.mark.parametrize(
    ("skins", "extra", "wanted", "names", "said"),
    [
        ([{"joints": [3]}, {"joints": [1, 2, 3, 4]}], (), None, ALL, ""),
        ([{"joints": [3]}, {"joints": [1, 2, 4]}], (), None, ALL, ""),
        ([{"joints": [5], "name": "Hat"}, {"joints": [1, 2, 3, 4]}], (HAT,), None, ALL, "out: Hat (1 joint)"),
        ([{"joints": [2, 3], "name": "Face"}, {"joints": [1, 2, 3, 4]}], (), "face", ("Chest", "Head"), ""),
        ([{"joints": [2, 3]}, {"joints": [1, 2, 3, 4]}], (), "0", ("Chest", "Head"), ""),
        ([{"joints": [3]}, {"joints": [2]}], ({"name": "Vest", "skin": 1},), "vest", ("Chest",), ""),
    ],
)  # fmt: skip
def test_all_skins_of_a_figure_are_read_and_others_are_named(
    skins: list[dict[str, Any]],
    extra: tuple[dict[str, Any], ...],
    wanted: str | None,
    names: tuple[str, ...],
    said: str,
    tmp_path: Path,
) -> None:
    path = glb(tmp_path / "skins.glb", [*FIGURE, *extra], skins)
    found = read_glb(path, choice=Choice(skin=wanted))
    assert found.skeleton.names == names
    assert said in "".join(found.notes) and bool(said) == bool(found.notes)


def test_two_dancers_are_asked_about(tmp_path: Path, bunraku: Command) -> None:
    second = [
        {**node, "children": [child + 5 for child in node.get("children", [])]}
        if "children" in node
        else node
        for node in FIGURE
    ]
    skins = [{"joints": [1, 2, 3, 4], "name": "Ada"}, {"joints": [6, 7, 8, 9], "name": "Bo"}]
    both = [("Duet", 1.0, (1, 2, 6, 7))]
    path, out = glb(tmp_path / "two.glb", [*FIGURE, *second], skins, both), tmp_path / "out.npz"
    refused = bunraku("convert", path, out, status=2).err
    assert "Ada (4 joints); Bo (4 joints)" in refused and "--skin" in refused
    bunraku("convert", path, out, "--skin", "bo")
    assert np.load(out)["names"].tolist() == list(ALL)


@pytest.mark.parametrize(
    ("wanted", "frames", "said"),
    [
        (None, 5, "animation 'Dance' (2.0 s) read, left out: 'T-Pose' (0.0 s), 'Nod' (1.0 s)"),
        ("nod", 3, ""),
        ("0", 1, ""),
    ],
)
def test_the_longest_animation_is_read_and_the_others_are_named(
    wanted: str | None, frames: int, said: str, tmp_path: Path
) -> None:
    several = [("T-Pose", 0.0, (1,)), ("Dance", 2.0, (1, 2)), ("Nod", 1.0, (3,))]
    found = read_glb(
        glb(tmp_path / "several.glb", FIGURE, animations=several), choice=Choice(animation=wanted)
    )
    assert found.seconds * found.fps == len(found) and len(found) == (3 if frames == 5 else frames)
    assert said in "".join(found.notes) and bool(said) == bool(found.notes)
    assert ("--animation" in "".join(found.notes)) == bool(said)


def test_an_unknown_choice_is_refused_with_what_there_is(tmp_path: Path, bunraku: Command) -> None:
    path, out = glb(tmp_path / "one.glb", FIGURE), tmp_path / "out.npz"
    assert "It has: 'Dance'" in bunraku("convert", path, out, "--animation", "Jump", status=2).err
    assert "It has: '0'" in bunraku("convert", path, out, "--skin", "Body", status=2).err
    bunraku("convert", path, out)
    assert "Only a .glb" in bunraku("convert", out, tmp_path / "b.npz", "--animation", "1", status=2).err


def test_several_root_bones_hang_from_their_armature(tmp_path: Path) -> None:
    nodes = [FIGURE[0] | {"children": [1, 5]}, *FIGURE[1:], {"name": "IK_Target", "translation": [0.5, 0, 0]}]
    skins = [{"joints": [1, 2, 3, 4, 5]}]
    path = glb(tmp_path / "roots.glb", nodes, skins)
    assert read_glb(path).skeleton.names == ("Armature", *ALL, "IK_Target")
    found, guesses = read_as_given(path)
    assert found.skeleton.names == ALL
    assert "left out, with IK_Target: the hips are the root" in guesses[0].message


def test_without_a_skin_the_largest_of_what_moves_is_the_figure(tmp_path: Path) -> None:
    nodes = [*FIGURE, {"name": "Camera", "camera": 0}]
    found = read_glb(glb(tmp_path / "bare.glb", nodes, (), [("Take", 1.0, (1, 2, 3, 4, 5))]))
    assert found.skeleton.names == ALL
    assert "'Hips' (4 joints) read, left out: 'Camera' (1 joint)" in found.notes[0]


def test_joints_without_a_name_and_with_one_that_is_taken_get_their_own(tmp_path: Path) -> None:
    nodes = [{key: value for key, value in node.items() if key != "name"} for node in FIGURE]
    nodes[2]["name"] = nodes[3]["name"] = "Bone"
    nodes[4]["name"] = ""
    found = read_glb(glb(tmp_path / "names.glb", nodes))
    assert found.skeleton.names == ("joint0", "Bone", "Bone_2", "joint3")
    assert "names changed: 'Bone' to 'Bone_2', '' to 'joint3'" in found.notes[0]
