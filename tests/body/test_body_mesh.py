"""The body around any skeleton: closed, in one piece, as symmetrical as the skeleton, moved by its joints."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from appliance.body.bake import openness
from appliance.body.body_mesh import body_mesh
from appliance.body.skinning import BodyMesh
from appliance.body.surface import Finer, Grid, finer_grid, surface_of
from appliance.body.volumes import Group, Slab, grid_around, sampled, settled
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from tests.projector import skeletons
from tools.body_figures import skin, volume

Faces = NDArray[np.int32]
FIGURES = ("dancer", "mixamo", "quadruped")


@cache
def skeleton_of(name: str) -> Skeleton:
    make: Callable[[], Skeleton] = skeletons.ALL[name]
    return make()


@cache
def mesh_of(name: str) -> BodyMesh:
    return body_mesh(skeleton_of(name))


def edges_of(faces: Faces) -> NDArray[np.int32]:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def turned(skeleton: Skeleton, turns: dict[int, NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    """Positions and world rotations after some joints turned about themselves."""
    pose = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
    for joint, turn in turns.items():
        pose[joint] = turn
    return skeleton.forward_kinematics(pose, np.zeros(3))


@pytest.mark.parametrize("name", skeletons.ALL)
def test_the_surface_is_closed_and_looks_outwards(name: str) -> None:
    mesh = mesh_of(name)
    edges = edges_of(mesh.faces)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).all(), "an edge that more than two triangles share, or two in the same sense"
    assert np.array_equal(once, np.unique(edges[:, ::-1], axis=0)), "an edge that has one triangle alone"
    assert len(mesh.vertices) - len(mesh.faces) // 2 == 2, "a hole through it, as between two fingers"
    assert volume(mesh.vertices, mesh.faces) > 0
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-3)


@pytest.mark.parametrize("name", skeletons.ALL)
def test_the_surface_is_in_one_piece(name: str) -> None:
    mesh = mesh_of(name)
    label = np.arange(len(mesh.vertices))
    edges = edges_of(mesh.faces)
    while True:
        before = label.copy()
        np.minimum.at(label, edges[:, 0], label[edges[:, 1]])
        label = label[label]
        if np.array_equal(label, before):
            break
    assert len(np.unique(label)) == 1


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_has_the_size_of_a_body(name: str) -> None:
    mesh = mesh_of(name)
    assert 8_000 <= len(mesh.vertices) <= 25_000
    share = volume(mesh.vertices, mesh.faces) / mesh.height**3
    assert 0.008 < share < 0.025  # a dancer of 1.53 m: 28 to 90 litres
    facing = np.cross(
        mesh.vertices[mesh.faces[:, 1]] - mesh.vertices[mesh.faces[:, 0]],
        mesh.vertices[mesh.faces[:, 2]] - mesh.vertices[mesh.faces[:, 0]],
    )
    agree = np.einsum("fi,fi->f", facing, mesh.normals[mesh.faces[:, 0]]) > 0
    assert agree.mean() > 0.995


@pytest.mark.parametrize("name", ["dancer", "mixamo", "quadruped", "toy"])
def test_a_rest_pose_with_room_is_the_one_that_is_modelled(name: str) -> None:
    np.testing.assert_array_equal(
        mesh_of(name).bind_world, np.tile([1, 0, 0, 0], (len(skeleton_of(name)), 1))
    )


def test_limbs_that_lie_in_each_other_at_rest_are_spread() -> None:
    mesh, skeleton = mesh_of("all along x"), skeleton_of("all along x")
    places = {name: mesh.bind_positions[skeleton.index(name)] for name in skeleton.names}
    assert places["Head"][1] - places["Hips"][1] > 0.6
    assert places["LeftFoot"][1] - places["Hips"][1] < -0.8
    for one, other in (("LeftHand", "RightHand"), ("LeftHand", "Hips"), ("LeftFoot", "RightFoot")):
        assert np.linalg.norm(places[one] - places[other]) > 0.2
    front = mesh.bind_positions[skeleton.index("LeftToe")] - places["LeftFoot"]
    left = places["LeftHand"] - places["RightHand"]
    assert np.cross(left, [0, 1, 0]) @ front > 0, "the feet point backwards"
    bones = np.linalg.norm(mesh.bind_positions[1:] - mesh.bind_positions[list(skeleton.parents[1:])], axis=1)
    np.testing.assert_allclose(bones, np.linalg.norm(skeleton.offsets[1:], axis=1), atol=1e-5)


@pytest.mark.parametrize("name", ["mixamo", "quadruped", "toy"])
def test_a_symmetrical_skeleton_gives_a_symmetrical_body(name: str) -> None:
    vertices = mesh_of(name).vertices
    mirrored = vertices * np.array([-1, 1, 1], np.float32)
    spacing = 1e-3 * mesh_of(name).height
    seen = {tuple(cell) for cell in np.round(vertices / spacing).astype(int)}
    near = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]
    alone = [
        cell
        for cell in np.round(mirrored / spacing).astype(int)
        if not any((cell[0] + x, cell[1] + y, cell[2] + z) in seen for x, y, z in near)
    ]
    assert len(alone) < 0.002 * len(vertices)


@pytest.mark.parametrize("name", skeletons.ALL)
def test_weights_are_shares_of_real_joints(name: str) -> None:
    mesh = mesh_of(name)
    assert mesh.joints.max() < len(skeleton_of(name))
    assert (mesh.weights >= 0).all()
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1, atol=1e-5)
    assert (np.diff(mesh.weights, axis=1) <= 0).all(), "the strongest does not come first"


@pytest.mark.parametrize("name", skeletons.ALL)
def test_in_its_bind_pose_the_body_is_unchanged(name: str) -> None:
    mesh = mesh_of(name)
    vertices, normals = skin(mesh, mesh.bind_positions, mesh.bind_world)
    np.testing.assert_allclose(vertices, mesh.vertices, atol=1e-5)
    np.testing.assert_allclose(normals, mesh.normals, atol=1e-5)


@pytest.mark.parametrize("name", skeletons.ALL)
def test_every_joint_with_a_bone_moves_something(name: str) -> None:
    mesh, skeleton = mesh_of(name), skeleton_of(name)
    face = {j for j, p in enumerate(skeleton.parents) if p >= 0 and "head" in skeleton.names[p].casefold()}
    bones = {parent for joint, parent in enumerate(skeleton.parents) if skeleton.offsets[joint].any()}
    bones |= {joint for joint, _ in skeleton.ends}
    turn = quaternion.from_axis_angle([1, 1, 1], 0.5)
    at_rest, _ = skin(mesh, *turned(skeleton, {}))
    for joint in sorted(bones - face - {-1}):
        vertices, _ = skin(mesh, *turned(skeleton, {joint: turn}))
        moved = np.linalg.norm(vertices - at_rest, axis=1)
        assert moved.max() > 1e-3 * mesh.height, f"{skeleton.names[joint]} moves nothing"


def test_a_rigid_turn_of_all_keeps_the_shape() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    turn = quaternion.from_axis_angle([0.3, 1, -0.2], 2.0)
    vertices, _ = skin(mesh, *turned(skeleton, {0: turn}))
    np.testing.assert_allclose(vertices, quaternion.rotate(turn, mesh.vertices.astype(float)), atol=1e-4)


@pytest.mark.parametrize(
    ("joint", "child"), [("lForeArm", "lHand"), ("lShin", "lFoot"), ("rShldr", "rForeArm")]
)
def test_a_bent_or_twisted_limb_keeps_its_volume_and_length(joint: str, child: str) -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    whole = volume(mesh.vertices, mesh.faces)
    bone = skeleton.offsets[skeleton.index(child)]
    for axis, degrees in ((bone, 120.0), (np.cross(bone, [0.3, 0.2, 1.0]), 90.0)):
        turn = quaternion.from_axis_angle(axis, np.radians(degrees))
        vertices, _ = skin(mesh, *turned(skeleton, {skeleton.index(joint): turn}))
        assert volume(vertices, mesh.faces) == pytest.approx(whole, rel=0.04)
        moved = mesh.joints[:, 0] == skeleton.index(child)
        before, after = mesh.vertices[moved].mean(axis=0), vertices[moved].mean(axis=0)
        elbow = mesh.bind_positions[skeleton.index(joint)]
        assert np.linalg.norm(after - elbow) == pytest.approx(np.linalg.norm(before - elbow), rel=0.02)


@pytest.mark.parametrize(("name", "thigh"), [("dancer", "lThigh"), ("mixamo", "mixamorig:LeftUpLeg")])
def test_a_raised_thigh_keeps_its_volume(name: str, thigh: str) -> None:
    """At 95 degrees the dancer gains or loses less than 320 ml; linear blending loses 1 l."""
    mesh, skeleton = mesh_of(name), skeleton_of(name)
    most, most_aside = 9e-5 * mesh.height**3, 4e-4 * mesh.height**3

    def gain(axis: tuple[int, int, int], degrees: float, linear: bool = False) -> float:
        turn = quaternion.from_axis_angle(axis, np.radians(degrees))
        vertices, _ = skin(mesh, *turned(skeleton, {skeleton.index(thigh): turn}), linear)
        return volume(vertices, mesh.faces) - volume(mesh.vertices, mesh.faces)

    for degrees in (-115, -95, -60, -30, 30):
        assert abs(gain((1, 0, 0), degrees)) < most, degrees
    assert gain((1, 0, 0), -95, linear=True) < -2 * most
    assert abs(gain((0, 0, 1), 60)) < most_aside


def test_legs_begin_where_a_dancer_s_do() -> None:
    """The crotch is at 0.46 of the stature, the hip joints at 0.53."""
    mesh = mesh_of("dancer")
    low, high = mesh.vertices[:, 1].min(), mesh.vertices[:, 1].max()
    middle = mesh.vertices[np.abs(mesh.vertices[:, 0]) < 0.003 * mesh.height, 1]
    assert 0.44 < (middle.min() - low) / (high - low) < 0.49


@pytest.mark.parametrize(("name", "arm"), [("dancer", "lShldr"), ("mixamo", "mixamorig:LeftArm")])
def test_an_armpit_is_no_crater(name: str, arm: str) -> None:
    """A pit between chest and back muscles let 0.14 of the light in."""
    mesh, skeleton = mesh_of(name), skeleton_of(name)
    places = (mesh.vertices - mesh.bind_positions[skeleton.index(arm)]) / mesh.height
    near = np.linalg.norm(places - [0.01, -0.055, 0.0], axis=1) < 0.05
    light = openness((mesh.vertices / mesh.height).astype(np.float32), mesh.normals, mesh.faces)
    assert near.sum() > 100 and light[near].min() > 0.4


def test_a_throat_is_no_slot_between_two_muscles() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    places = (mesh.vertices - mesh.bind_positions[skeleton.index("neck")]) / mesh.height
    for above in np.arange(-0.01, 0.015, 0.005):
        level = places[np.abs(places[:, 1] - above) < 0.006]
        middle, beside = (
            float(level[np.abs(np.abs(level[:, 0]) - aside) < 0.005, 2].max()) for aside in (0.0, 0.009)
        )
        assert beside - middle < 0.0005, above


def test_a_hip_is_widest_at_the_joint_and_its_outline_has_no_dent() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    places = mesh.vertices / mesh.height
    side = places[(places[:, 0] > 0) & (places[:, 0] < 0.15)]
    levels = np.arange(0.10, -0.18, -0.01)
    wide = np.array([side[np.abs(side[:, 1] - level) < 0.006, 0].max() for level in levels])
    widest = int(wide.argmax())
    hip = mesh.bind_positions[skeleton.index("lThigh"), 1] / mesh.height
    assert abs(levels[widest] - hip) < 0.045
    assert np.diff(wide[: widest + 1]).min() > -5e-4 and np.diff(wide[widest:]).max() < 5e-4


def test_a_foot_is_a_wedge_on_a_slim_ankle() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    places = (mesh.vertices - mesh.bind_positions[skeleton.index("lFoot")]) / mesh.height
    near = places[(np.abs(places[:, 0]) < 0.06) & (places[:, 1] < 0.07)]
    ankle = np.ptp(near[np.abs(near[:, 1] - 0.02) < 0.005, 0])
    foot = near[near[:, 1] < 0.0]
    heel, ball, toes = (foot[np.abs(foot[:, 2] - ahead) < 0.005] for ahead in (-0.03, 0.065, 0.10))
    assert np.ptp(ball[:, 0]) > 1.35 * ankle and np.ptp(ball[:, 0]) > 1.4 * np.ptp(heel[:, 0])
    assert np.ptp(toes[:, 0]) > 0.35 * np.ptp(ball[:, 0]), "a hoof"
    assert toes[:, 1].max() < ball[:, 1].max() - 0.003


def test_fingers_are_thick_enough_for_the_last_row() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    for finger in ("lIndex2", "lMid2", "lRing2", "lPinky2"):
        skin_of = (mesh.joints[:, 0] == skeleton.index(finger)) & (mesh.weights[:, 0] > 0.6)
        places = mesh.vertices[skin_of] / mesh.height
        places = places - places.mean(axis=0)
        along = np.linalg.svd(places, full_matrices=False)[2][0]
        radius = np.linalg.norm(places - np.outer(places @ along, along), axis=1).mean()
        assert 0.0055 < radius < 0.0075


def test_no_fold_beside_the_neck_when_arms_are_above_the_head() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    turns = {
        skeleton.index(side + joint): quaternion.from_axis_angle((0, 0, sign), np.radians(degrees))
        for side, sign in (("l", 1), ("r", -1))
        for joint, degrees in (("Shldr", 62), ("Collar", 22))
    }
    vertices, _ = skin(mesh, *turned(skeleton, turns))
    corners = vertices[mesh.faces].astype(float)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    edges, owner = np.sort(edges_of(mesh.faces), axis=1), np.tile(np.arange(len(mesh.faces)), 3)
    order = np.lexsort(edges.T)
    one, other = facing[owner[order[::2]]], facing[owner[order[1::2]]]
    bends = np.degrees(np.arccos(np.clip((one * other).sum(axis=1), -1, 1)))
    at = mesh.vertices[edges[order[::2], 0]] / mesh.height
    collar = mesh.bind_positions[skeleton.index("lCollar")] / mesh.height
    near = (np.linalg.norm(at - collar, axis=1) < 0.09) & (at[:, 1] > collar[1] - 0.03)
    assert near.sum() > 500 and np.percentile(bends[near], 99) < 33.0


def test_an_arm_at_the_hip_is_not_tied_to_the_hip() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    legs = [skeleton.index(name) for name in ("hip", "lThigh", "rThigh", "abdomen")]
    hand = np.isin(mesh.joints[:, 0], [skeleton.index(name) for name in ("lHand", "rHand", "lForeArm")])
    assert hand.sum() > 100
    assert not (np.isin(mesh.joints[hand], legs) & (mesh.weights[hand] > 1e-6)).any()


def test_neighbours_on_the_surface_move_alike() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    weights = np.zeros((len(mesh.vertices), len(skeleton)), np.float32)
    np.put_along_axis(weights, mesh.joints.astype(int), 0, axis=1)
    for place in range(4):
        np.add.at(weights, (np.arange(len(weights)), mesh.joints[:, place]), mesh.weights[:, place])
    fingers = [j for j in range(len(skeleton)) if any(w in skeleton.names[j] for w in ("Thumb", "1", "2"))]
    edges = edges_of(mesh.faces)
    jump = np.abs(weights[edges[:, 0]] - weights[edges[:, 1]])
    jump[:, fingers] = 0.0
    hands = np.isin(mesh.joints[:, 0], [*fingers, skeleton.index("lHand"), skeleton.index("rHand")])
    assert jump[~hands[edges[:, 0]]].max() < 0.26


def test_a_ball_is_a_ball() -> None:
    grid = Grid(np.full(3, -1.0), 0.05, (41, 41, 41))
    x, y, z = np.meshgrid(*(grid.axis(number) for number in range(3)), indexing="ij")
    vertices, normals, faces = surface_of(np.sqrt(x * x + y * y + z * z) - np.float32(0.7), grid)
    assert volume(vertices, faces) == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=0.01)
    radii = np.linalg.norm(vertices, axis=1)
    np.testing.assert_allclose(radii, 0.7, atol=0.005)
    np.testing.assert_allclose(normals, vertices / radii[:, None], atol=0.02)


def test_a_thin_finger_gets_round() -> None:
    """A finger 2.4 cells thick: the surface of the samples is several times as far off as the settled one."""
    finger = Slab(0, np.zeros(3), np.array([0.5, 0.3, 0.1]), 0.06, 0.06, 0.0, np.array([0.0, 0.0, 1.0]))
    group = Group((finger,), 0.0)
    grid = grid_around([group], 0.05)
    rough, _, _ = surface_of(sampled(group, [], grid), grid)
    smooth, normals = settled(group, [], rough.astype(float), 0.05)
    off_rough, off = (np.abs(finger.distance(*points.T)).mean() for points in (rough, smooth))
    assert off < 0.25 * off_rough
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)


def test_sheets_that_would_share_a_cell_are_joined_instead() -> None:
    field = np.full((6, 6, 6), 1.0, np.float32)
    field[2, 2, 2] = field[3, 3, 3] = field[2, 4, 2] = field[3, 3, 1] = -0.4
    _, _, faces = surface_of(field, Grid(np.zeros(3), 0.1, (6, 6, 6)))
    edges = edges_of(faces)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).all()
    assert np.array_equal(once, np.unique(edges[:, ::-1], axis=0))


def ball_field(grid: Grid) -> NDArray[np.float32]:
    """The distance from a ball of 0.7 m."""
    x, y, z = np.meshgrid(*(grid.axis(number) for number in range(3)), indexing="ij")
    field: NDArray[np.float32] = np.sqrt(x * x + y * y + z * z) - np.float32(0.7)
    return field


@pytest.mark.parametrize("low", [(5, 20, 12), (16, 16, 30), (20, 4, 4)])
def test_a_surface_of_cells_of_two_sizes_is_closed(low: tuple[int, int, int]) -> None:
    grid, first = Grid(np.full(3, -1.0), 0.05, (41, 41, 41)), np.array(low)
    boxes = [
        Finer(at, ball_field(finer_grid(grid, at, at + 10))) for at in (first, np.minimum(first + 6, 30))
    ]
    vertices, normals, faces = surface_of(ball_field(grid), grid, boxes)
    once, counts = np.unique(edges_of(faces), axis=0, return_counts=True)
    assert (counts == 1).all() and np.array_equal(once, np.unique(edges_of(faces)[:, ::-1], axis=0))
    assert len(vertices) > len(surface_of(ball_field(grid), grid)[0])
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 0.7, atol=0.005)
    np.testing.assert_allclose(normals, vertices / 0.7, atol=0.04)


def test_a_surface_that_grazes_an_edge_between_cells_of_two_sizes_is_closed() -> None:
    """The middle of a whole cell's edge is inside and both its ends are not."""
    grid = Grid(np.zeros(3), 1.0, (9, 9, 9))
    fine = np.ones(finer_grid(grid, np.full(3, 2), np.full(3, 6)).shape, np.float32)
    fine[3, 2, 2] = -0.5
    field = np.ones(grid.shape, np.float32)
    field[3, 2, 3] = -0.5  # the surface also crosses the face between the two whole cells at that edge
    _, _, faces = surface_of(field, grid, [Finer(np.full(3, 2), fine)])
    once, counts = np.unique(edges_of(faces), axis=0, return_counts=True)
    assert (counts == 1).all() and np.array_equal(once, np.unique(edges_of(faces)[:, ::-1], axis=0))


def pieces(mesh: BodyMesh, chosen: NDArray[np.bool_]) -> int:
    """How many pieces the chosen vertices are, along the surface."""
    label = np.arange(len(chosen))
    edges = edges_of(mesh.faces)
    edges = edges[chosen[edges].all(axis=1)]
    for _ in range(len(chosen)):
        before = label.copy()
        np.minimum.at(label, edges[:, 0], label[edges[:, 1]])
        if np.array_equal(label, before):
            break
    return len(np.unique(label[chosen]))


HANDS = [("dancer", "lHand"), ("dancer", "rHand"), ("mixamo", "mixamorig:LeftHand")]


@pytest.mark.parametrize(("name", "hand"), HANDS)
def test_a_hand_has_fingers_also_where_the_skeleton_has_none(name: str, hand: str) -> None:
    """The two in the middle lie against each other."""
    mesh, wrist = mesh_of(name), mesh_of(name).bind_positions[skeleton_of(name).index(hand)]
    out = np.linalg.norm(mesh.vertices - wrist, axis=1)
    near = (out < 0.13 * mesh.height) & (np.abs(mesh.vertices[:, 0]) > abs(wrist[0]))
    near &= mesh.vertices[:, 0] * wrist[0] > 0
    shares = np.arange(0.5, 0.95, 0.05)
    assert max(pieces(mesh, near & (out > share * out[near].max())) for share in shares) >= 3
    assert pieces(mesh, near & (out > 0.0)) == 1


def finger(side: str, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Knuckle and tip (3,) of one of the dancer's fingers, in heights; the palm looks downwards."""
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    knuckle = mesh.bind_positions[skeleton.index(f"{side}{name}1")] / mesh.height
    skin_of = mesh.vertices[mesh.joints[:, 0] == skeleton.index(f"{side}{name}2")] / mesh.height
    far = np.argsort(np.linalg.norm(skin_of - knuckle, axis=1))[-5:]
    return knuckle.astype(float), skin_of[far].mean(axis=0).astype(float)


FINGERS = ("Index", "Mid", "Ring", "Pinky")


@pytest.mark.parametrize("side", "lr")
def test_a_hand_at_rest_is_relaxed(side: str) -> None:
    """Its fingers lie together, the tips hardly further apart than the knuckles; each bends more to the palm
    than the one before; the thumb lies beside the index."""
    bends, tips, knuckles = [], [], []
    for name in FINGERS:
        knuckle, tip = finger(side, name)
        ahead = np.hypot(*(tip - knuckle)[[0, 2]])
        bends.append(np.degrees(np.arctan2(knuckle[1] - tip[1], ahead)))
        tips.append(tip)
        knuckles.append(knuckle)
    assert bends[0] > 5 and min(np.diff(bends)) > 1, bends
    assert np.linalg.norm(tips[0] - tips[-1]) < 1.45 * np.linalg.norm(knuckles[0] - knuckles[-1])
    assert np.linalg.norm(tips[1] - tips[2]) < 0.018
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    index = np.isin(mesh.joints[:, 0], [skeleton.index(f"{side}Index{part}") for part in (1, 2)])
    away = np.linalg.norm(mesh.vertices[index] / mesh.height - finger(side, "Thumb")[1], axis=1)
    assert 0.005 < away.min() < 0.022


def test_hands_are_left_and_right_alike() -> None:
    for name in (*FINGERS, "Thumb"):
        left, right = finger("l", name)[1], finger("r", name)[1]
        np.testing.assert_allclose(left, right * [-1, 1, 1], atol=0.002)


@pytest.mark.parametrize("side", "lr")
def test_a_wrist_is_narrower_than_hand_and_forearm(side: str) -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    elbow, wrist = (mesh.bind_positions[skeleton.index(side + name)] for name in ("ForeArm", "Hand"))
    along = (mesh.vertices - wrist) @ (wrist - elbow) / np.linalg.norm(wrist - elbow) / mesh.height
    arm = np.linalg.norm(mesh.vertices - wrist, axis=1) < 0.15 * mesh.height

    def wide(at: float) -> float:
        """The longer axis of a section across the arm, in heights."""
        section = mesh.vertices[arm & (np.abs(along - at) < 0.004)] / mesh.height
        section = section - section.mean(axis=0)
        return float(np.ptp(section @ np.linalg.svd(section)[2].T, axis=0).max())

    narrow = min(wide(at) for at in (-0.03, -0.02, -0.01))
    assert narrow < 0.034 and narrow < 0.68 * wide(-0.10) and narrow < 0.56 * wide(0.04)


def test_fingers_that_span_no_palm_are_a_plain_hand() -> None:
    """Some skeletons have all bones of the palm begin in the wrist."""
    dancer = skeletons.dancer()
    offsets = dancer.offsets.copy()
    for hand in (dancer.index("lHand"), dancer.index("rHand")):
        knuckles = [joint for joint, parent in enumerate(dancer.parents) if parent == hand]
        offsets[knuckles] = 0.0
    body = body_mesh(Skeleton(dancer.names, dancer.parents, offsets, dancer.ends))
    assert np.isfinite(body.vertices).all() and len(body.faces) > 20_000


def test_a_head_has_a_crown_a_nose_and_a_chin() -> None:
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    eyes = mesh.bind_positions[[skeleton.index(name) for name in ("leftEye", "rightEye")]].mean(axis=0)
    face = mesh.vertices[np.isin(mesh.joints[:, 0], [skeleton.index("head")])] / mesh.height
    eyes = eyes / mesh.height
    assert 0.05 < face[:, 1].max() - eyes[1] < 0.08, "the crown is flat, or too high"
    level = face[np.abs(face[:, 0]) < 0.006]
    nose = level[level[:, 2].argmax()]
    assert -0.04 < nose[1] - eyes[1] < -0.005
    under = level[(level[:, 1] < nose[1] - 0.006) & (level[:, 1] > nose[1] - 0.012), 2].max()
    assert nose[2] - under > 0.003, "no nose stands before the lip"
    assert np.ptp(face[:, 0]) == pytest.approx(0.105, abs=0.015), "ears"


def test_a_face_has_no_ledge() -> None:
    """The profile recedes gently, also below the nose: a ledge there throws a hard shadow."""
    mesh, skeleton = mesh_of("dancer"), skeleton_of("dancer")
    places = (mesh.vertices - mesh.bind_positions[skeleton.index("head")]) / mesh.height
    middle = places[(np.abs(places[:, 0]) < 0.004) & (places[:, 2] > 0)]
    levels = np.arange(-0.01, 0.08, 0.005)
    front = np.array([middle[np.abs(middle[:, 1] - level) < 0.003, 2].max() for level in levels])
    assert np.abs(np.diff(front)).max() < 0.006
    assert front.max() - np.median(front) > 0.004, "no nose"


def test_a_pelvis_is_not_wider_than_hips_and_thighs() -> None:
    mesh = mesh_of("dancer")
    at = mesh.vertices[np.abs(mesh.vertices[:, 0]) < 0.14 * mesh.height]

    def width(height_m: float) -> float:
        return float(np.ptp(at[np.abs(at[:, 1] - height_m) < 0.01, 0]))

    waist, crest, hip, thigh = (width(y) for y in (0.20, 0.08, 0.0, -0.10))
    assert waist < crest < 1.02 * hip and thigh > 0.85 * hip
