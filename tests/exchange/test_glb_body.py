"""A skinned figure of another program becomes a show's body, moved by the show's joints; or it is refused."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.body.bake import bake
from appliance.body.body_mesh import body_mesh
from appliance.body.mesh_file import MESH_FILE, read_mesh
from appliance.body.skinning import BodyMesh
from appliance.exchange import glb_body
from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_body import BODY_FILE, body_of, write_body
from appliance.exchange.glb_writing import write_glb
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from tests.body.test_body_mesh import skin, turned
from tests.projector import skeletons


def figure(path: Path, skeleton: Skeleton) -> Path:
    """A file with a skinned figure at rest."""
    poses = np.tile(quaternion.IDENTITY.astype(float), (2, len(skeleton), 1))
    write_glb(path, Recording(skeleton, poses, np.zeros((2, 3)), 50.0))
    return path


def otherwise(skeleton: Skeleton) -> Skeleton:
    """The same figure in centimetres, seen from behind."""
    turn = quaternion.from_axis_angle([0, 1, 0], np.pi)
    ends = [(joint, 100 * quaternion.rotate(turn, np.array(end))) for joint, end in skeleton.ends]
    return replace(
        skeleton,
        offsets=100 * quaternion.rotate(turn, skeleton.offsets),
        ends=tuple((joint, (float(x), float(y), float(z))) for joint, (x, y, z) in ends),
    )


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> BodyMesh:
    path = figure(tmp_path_factory.mktemp("foreign") / BODY_FILE, skeletons.mixamo())
    return body_of(path, skeletons.dancer())


def far_from(mesh: BodyMesh, joint: str, reach: float = 0.12) -> float:
    """Share of the vertices moved by a joint that are further than `reach` heights from its bone."""
    skeleton = skeletons.dancer()
    number = skeleton.index(joint)
    moved = mesh.vertices[(mesh.joints[:, 0] == number) & (mesh.weights[:, 0] > 0.8)]
    child = next(c for c, parent in enumerate(skeleton.parents) if parent == number)
    start, end = mesh.bind_positions[number], mesh.bind_positions[child]
    along = np.clip((moved - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
    away = np.linalg.norm(moved - start - along[:, None] * (end - start), axis=1)
    assert len(moved) > 50
    return float((away > reach * mesh.height).mean())


def test_each_bone_wears_its_part_of_the_figure(fitted: BodyMesh) -> None:
    for joint in ("lShldr", "rForeArm", "lThigh", "rShin"):
        assert far_from(fitted, joint) < 0.02, joint
    own = body_mesh(skeletons.dancer())
    for axis in (0, 1):  # the other figure's feet are longer
        assert np.ptp(fitted.vertices[:, axis]) == pytest.approx(np.ptp(own.vertices[:, axis]), rel=0.15)
    np.testing.assert_allclose(fitted.weights.sum(axis=1), 1, atol=1e-5)
    assert (np.diff(fitted.weights, axis=1) <= 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(fitted.normals, axis=1), 1, atol=1e-3)


def test_the_shows_joints_move_it(fitted: BodyMesh) -> None:
    skeleton = skeletons.dancer()
    turn = quaternion.from_axis_angle([0, 1, 0], 1.5)
    vertices, _ = skin(fitted, *turned(skeleton, {skeleton.index("lForeArm"): turn}))
    moved = np.linalg.norm(vertices - fitted.vertices, axis=1)
    hand = fitted.joints[:, 0] == skeleton.index("lHand")
    legs = np.isin(fitted.joints[:, 0], [skeleton.index(name) for name in ("lThigh", "rThigh", "rForeArm")])
    assert moved[hand].min() > 0.1 and moved[legs].max() < 1e-4


def test_centimetres_and_a_turned_figure_come_out_the_same(fitted: BodyMesh, tmp_path: Path) -> None:
    other = body_of(figure(tmp_path / BODY_FILE, otherwise(skeletons.mixamo())), skeletons.dancer())
    for axis in range(3):
        for of in (np.min, np.max):
            expected = of(fitted.vertices[:, axis])
            assert of(other.vertices[:, axis]) == pytest.approx(expected, abs=0.03 * fitted.height)
    front = [one.vertices[one.joints[:, 0] == 4, 2].max() for one in (fitted, other)]
    assert front[0] == pytest.approx(front[1], abs=0.02), "the nose looks back"


def test_a_bundle_gets_it_once_and_its_own_body_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    skeleton = skeletons.dancer()
    assert write_body(tmp_path, skeleton)
    own = read_mesh(tmp_path, skeleton)
    figure(tmp_path / BODY_FILE, skeletons.mixamo())
    assert write_body(tmp_path, skeleton)
    worn = read_mesh(tmp_path, skeleton)
    assert own is not None and worn is not None and len(own.vertices) != len(worn.vertices)
    assert worn.baked is not None and np.array_equal(worn.baked.order, bake(worn).order)
    monkeypatch.setattr(glb_body, "body_of", lambda *_: pytest.fail("made again"))
    assert not write_body(tmp_path, skeleton)
    (tmp_path / BODY_FILE).unlink()
    assert write_body(tmp_path, skeleton)
    again = read_mesh(tmp_path, skeleton)
    assert again is not None and np.array_equal(again.faces, own.faces)


def changed(path: Path, change: str) -> None:
    """A file whose JSON text has other words, of the same length."""
    before, after = change.split(">")
    data = path.read_bytes()
    assert before.encode() in data
    path.write_bytes(data.replace(before.encode(), after.encode().ljust(len(before))[: len(before)]))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ('"skin":0>"skim":0', "No skinned figure"),
        ("JOINTS_0>JOINTS_7", "not skinned"),
        ('"POSITION":0>"POSITION":9', "damaged"),
        ("mixamorig:LeftLeg>mixamorig:Leftxxx", "left shin"),
    ],
)
def test_what_cannot_be_a_body_is_refused_in_words(change: str, says: str, tmp_path: Path) -> None:
    path = figure(tmp_path / BODY_FILE, skeletons.mixamo())
    changed(path, change)
    with pytest.raises(ExchangeError, match=says):
        write_body(tmp_path, skeletons.dancer())
    assert not (tmp_path / MESH_FILE).exists()


def test_too_many_triangles_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glb_body, "MOST_TRIANGLES", 1000)
    with pytest.raises(ExchangeError, match="Decimate"):
        body_of(figure(tmp_path / BODY_FILE, skeletons.mixamo()), skeletons.dancer())


def test_a_figure_without_any_area_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glb_body, "_WELD", 100.0)
    with pytest.raises(ExchangeError, match="no triangle has an area"):
        body_of(figure(tmp_path / BODY_FILE, skeletons.mixamo()), skeletons.dancer())


def test_a_show_that_is_no_person_takes_no_figure(tmp_path: Path) -> None:
    with pytest.raises(ExchangeError, match="the show's skeleton"):
        body_of(figure(tmp_path / BODY_FILE, skeletons.mixamo()), skeletons.toy())


def test_a_damaged_file_is_refused_and_never_crashes(tmp_path: Path) -> None:
    rng = random.Random(5)
    path = figure(tmp_path / BODY_FILE, skeletons.mixamo())
    whole = path.read_bytes()
    for _ in range(40):
        spoilt = bytearray(whole[: rng.randrange(len(whole))] if rng.random() < 0.3 else whole)
        for _ in range(rng.randrange(1, 9)):
            if spoilt:
                spoilt[rng.randrange(min(2000, len(spoilt)))] = rng.randrange(256)
        path.write_bytes(spoilt)
        try:
            mesh = body_of(path, skeletons.dancer())
        except ExchangeError:
            continue
        assert np.isfinite(mesh.vertices).all()
