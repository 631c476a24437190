"""Melt: the passage from a human body to an amorphous one, in every look that has a surface."""

from __future__ import annotations

from itertools import pairwise

import moderngl
import numpy as np
import pytest

from appliance.body.bake import sunk
from appliance.body.body_mesh import body_mesh
from appliance.body.rest_pose import anatomy_of
from appliance.pose.recording import Recording
from appliance.projector.picture import drawing
from appliance.projector.picture.drawing import source
from appliance.projector.picture.melting import BONES, Melting
from appliance.projector.picture.poses import poses_of
from appliance.projector.picture.scene import WHOLE, Scene
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import LookConfig
from tests.projector.golden_looks import AT_S, MEAN_LIMIT, SIZE, difference, renderer
from tests.projector.skeletons import rope

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
WITH_SURFACE = ("plaster", "ink", "cloud", "veil", "strings")


def melted(style: str, share: float) -> LookConfig:
    return LookConfig.model_validate({"name": "x", "style": style, "melt": share, "trail_s": 0.0, "fog": 0.0})


@pytest.mark.parametrize("style", WITH_SURFACE)
def test_the_figure_melts_step_by_step(style: str, dance: Recording, gl: moderngl.Context) -> None:
    """Each step changes the picture, and the whole way is longer than any step."""
    looks = {str(share): melted(style, share) for share in SHARES}
    with renderer(gl, dance.skeleton, looks) as made:
        pictures = [draw_still(gl, made, moment_of(dance, AT_S), name, SIZE) for name in looks]
    steps = [difference(a, b)[0] for a, b in pairwise(pictures)]
    whole = difference(pictures[0], pictures[-1])[0]
    assert min(steps) > 0.1 and max(steps) < whole < sum(steps)
    assert pictures[-1].max() > 100


@pytest.mark.parametrize("joints", [2, 300])
def test_any_number_of_joints_melts_into_as_many_bones_as_the_shader_has(joints: int) -> None:
    skeleton = rope(joints)
    mesh = body_mesh(skeleton)
    rest = np.tile(np.float32([1.0, 0.0, 0.0, 0.0]), (1, joints, 1))
    moment = moment_of(Recording(skeleton, rest, np.zeros((1, 3)), 50.0), 0.0)
    poses = poses_of(moment, moment.puppets[0], mesh.height, 0.0)
    found = Melting(mesh, anatomy_of(skeleton)).bones(poses, 0, 0.5)
    assert f"MELT_BONES = {BONES};" in source("melt")
    assert len(found["melt_from"]) == len(found["melt_way"]) == BONES
    assert 1 <= found["melt_bones"] <= BONES
    assert found["melt_bones"] == (BONES if joints > BONES else joints)


def test_the_face_sinks_before_the_body_swells(dance: Recording) -> None:
    """Else the nose of a third-melted figure is a ball; limbs keep their shape."""
    mesh = body_mesh(dance.skeleton)
    places = mesh.vertices / np.float32(mesh.height)
    way, calm = sunk(places, mesh.normals, mesh.faces)
    length = np.linalg.norm(way, axis=1)
    eyes = mesh.bind_positions[[dance.skeleton.index(f"{side}Eye") for side in ("left", "right")]].mean(
        axis=0
    )
    face = np.linalg.norm(places - eyes / mesh.height, axis=1) < 0.05
    nose = face & (places[:, 2] > places[face, 2].max() - 0.004)
    assert nose.sum() > 5 and length[nose].min() > 0.0045
    limb = np.isin(mesh.joints[:, 0], [dance.skeleton.index(name) for name in ("lThigh", "abdomen")])
    assert limb.sum() > 1000 and (length[limb] == 0.0).mean() > 0.95
    before, after = (
        np.linalg.norm(np.diff(normals[mesh.faces], axis=1), axis=2)[face[mesh.faces].all(axis=1)].mean()
        for normals in (mesh.normals, calm)
    )
    assert after < 0.6 * before


def test_a_fade_of_looks_is_a_passage_of_the_shape(dance: Recording, gl: moderngl.Context) -> None:
    """Halfway there is one half-melted figure, not two that shine through each other."""
    looks = {str(share): melted("plaster", share) for share in (0.0, 0.5, 1.0)}
    target = gl.framebuffer([gl.texture(SIZE, 4)])
    with renderer(gl, dance.skeleton, looks) as made:
        half = draw_still(gl, made, moment_of(dance, AT_S), "0.5", SIZE)
        made.draw(moment_of(dance, AT_S), "1.0", "0.0", 0.5, target)
        whole = draw_still(gl, made, moment_of(dance, AT_S), "1.0", SIZE)
    faded = np.frombuffer(target.read(components=4), np.uint8).reshape(SIZE[1], SIZE[0], 4)[::-1, :, :3]
    assert np.abs(faded.astype(int) - half).max() <= 2
    assert difference(half, whole)[0] > MEAN_LIMIT


def test_no_part_of_it_is_cut_off(
    dance: Recording, gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last step is drawn where the joints are and a margin: the lump lies inside of it."""
    with renderer(gl, dance.skeleton, {"x": melted("plaster", 1.0)}) as made:
        moments = [moment_of(dance, float(time_s)) for time_s in np.arange(2.0, dance.seconds, 9.0)]
        cut = [draw_still(gl, made, moment, "x", SIZE) for moment in moments]
        monkeypatch.setattr(Scene, "box", lambda *_args, **_keys: WHOLE)
        for before, moment in zip(cut, moments, strict=True):
            assert np.abs(before.astype(int) - draw_still(gl, made, moment, "x", SIZE)).max() <= 2


@pytest.mark.parametrize("style", ("plaster", "ink"))
def test_a_molten_figure_has_fewer_triangles_and_looks_the_same(
    style: str, dance: Recording, gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From where all of it is on the smooth surface; its details would only cost time."""
    with renderer(gl, dance.skeleton, {"x": melted(style, drawing.MOLTEN)}) as made:
        seen, triangles = [], []
        for begins in (9.0, drawing.MOLTEN):
            monkeypatch.setattr(drawing, "MOLTEN", begins)
            with gl.query(primitives=True) as counted:
                seen.append(draw_still(gl, made, moment_of(dance, AT_S), "x", SIZE))
            triangles.append(counted.primitives)
    assert triangles[1] < 0.75 * triangles[0]
    assert difference(*seen)[0] < 0.5 * MEAN_LIMIT


def test_its_surface_swims_while_the_dancer_stands_still(dance: Recording, gl: moderngl.Context) -> None:
    """A human body does not."""
    for share, moves in ((1.0, True), (0.0, False)):
        with renderer(gl, dance.skeleton, {"x": melted("veil", share)}) as made:
            moment = moment_of(dance, AT_S)
            first = draw_still(gl, made, moment, "x", SIZE)
            ago = [time_s + 1.0 for time_s in moment.trail_times]
            moment.time_s, moment.trail_times = moment.time_s + 1.0, ago
            later = draw_still(gl, made, moment, "x", SIZE)
        assert (difference(first, later)[0] > 0.5) == moves
