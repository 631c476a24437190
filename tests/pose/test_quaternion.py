"""Identities of the quaternion functions on arbitrary rotations, and their values against plain matrices."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from appliance.pose import quaternion as q4

TOLERANCE = 1e-9
components = st.floats(-1, 1, allow_nan=False, width=32)
rotations = (
    hnp.arrays(np.float64, (4,), elements=components)
    .filter(lambda q: float(np.linalg.norm(q)) > 1e-2)
    .map(lambda q: q / np.linalg.norm(q))
)
vectors = hnp.arrays(np.float64, (3,), elements=st.floats(-10, 10, allow_nan=False))
directions = vectors.filter(lambda v: float(np.linalg.norm(v)) > 1e-2)
shares = st.floats(0, 1, allow_nan=False)


def same_rotation(a: np.ndarray, b: np.ndarray, tolerance: float = TOLERANCE) -> bool:
    return bool(min(np.abs(a - b).max(), np.abs(a + b).max()) < tolerance)


def axis_matrix(axis: str, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


def test_the_units_multiply_as_hamilton_wrote() -> None:
    one, i, j, k = np.eye(4)
    for left, right, expected in [(i, j, k), (j, k, i), (k, i, j), (j, i, -k), (i, i, -one), (one, k, k)]:
        np.testing.assert_array_equal(q4.multiply(left, right), expected)


@given(rotations, rotations, rotations)
def test_the_product_is_associative_and_of_unit_length(a, b, c) -> None:
    left, right = q4.multiply(q4.multiply(a, b), c), q4.multiply(a, q4.multiply(b, c))
    np.testing.assert_allclose(left, right, atol=TOLERANCE)
    assert np.linalg.norm(left) == pytest.approx(1, abs=TOLERANCE)


@given(rotations, rotations, vectors)
def test_a_product_turns_by_its_second_factor_first(a, b, v) -> None:
    np.testing.assert_allclose(q4.rotate(q4.multiply(a, b), v), q4.rotate(a, q4.rotate(b, v)), atol=1e-8)


@given(rotations, vectors)
def test_rotate_is_q_v_q_inverse(q, v) -> None:
    by_product = q4.multiply(q4.multiply(q, np.array([0.0, *v])), q4.inverse(q))
    np.testing.assert_allclose(q4.rotate(q, v), by_product[1:], atol=1e-8)


@given(rotations, vectors)
def test_rotating_keeps_length_and_inverse_undoes_it(q, v) -> None:
    turned = q4.rotate(q, v)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(v), abs=1e-8)
    np.testing.assert_allclose(q4.rotate(q4.inverse(q), turned), v, atol=1e-8)


@given(rotations)
def test_every_representation_comes_back(q) -> None:
    assert same_rotation(q4.from_matrix(q4.to_matrix(q)), q, 1e-7)
    np.testing.assert_array_equal(q4.to_6d(q), q4.to_matrix(q)[:, :2].T.ravel())
    assert same_rotation(q4.from_axis_angle(*q4.to_axis_angle(q)), q)


@given(rotations)
def test_matrices_are_rotations(q) -> None:
    m = q4.to_matrix(q)
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=TOLERANCE)
    assert np.linalg.det(m) == pytest.approx(1, abs=TOLERANCE)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns_come_back_from_matrices(axis: int) -> None:
    half_turn = np.eye(4)[axis + 1]
    assert same_rotation(q4.from_matrix(q4.to_matrix(half_turn)), half_turn)


@given(directions, st.floats(-math.pi, math.pi))
def test_axis_angle_turns_about_its_axis_by_its_angle(axis, angle) -> None:
    q = q4.from_axis_angle(axis, angle)
    np.testing.assert_allclose(q4.rotate(q, axis), axis, atol=1e-8)
    assert q4.angle_between(q, q4.IDENTITY) == pytest.approx(abs(angle), abs=1e-7)
    found_axis, found_angle = q4.to_axis_angle(q)
    assert found_angle == pytest.approx(abs(angle), abs=1e-7)
    assert np.linalg.norm(found_axis) == pytest.approx(1)


def test_no_rotation_has_the_x_axis() -> None:
    axis, angle = q4.to_axis_angle(q4.IDENTITY)
    np.testing.assert_array_equal(axis, [1, 0, 0])
    assert angle == 0


@pytest.mark.parametrize("axes", ["".join(p) for n in (1, 2, 3) for p in product("xyz", repeat=n)])
def test_euler_angles_apply_in_the_order_written(axes: str) -> None:
    angles = np.radians([37.0, -81.0, 155.0])[: len(axes)]
    expected = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        expected = expected @ axis_matrix(axis, angle)
    np.testing.assert_allclose(q4.to_matrix(q4.from_euler(angles, axes)), expected, atol=TOLERANCE)


def test_no_euler_axes_are_no_rotation() -> None:
    np.testing.assert_array_equal(q4.from_euler(np.empty((5, 0)), ""), np.tile(q4.IDENTITY, (5, 1)))


@given(rotations)
def test_euler_zxy_comes_back(q) -> None:
    assert same_rotation(q4.from_euler(q4.to_euler_zxy(q), "zxy"), q, 1e-4)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_euler_zxy_at_gimbal_lock_is_the_same_rotation(pitch: float) -> None:
    q = q4.from_euler(np.radians([40.0, pitch, 25.0]), "zxy")
    angles = q4.to_euler_zxy(q)
    assert angles[2] == 0
    assert same_rotation(q4.from_euler(angles, "zxy"), q, 1e-7)


@given(rotations, rotations, shares)
def test_slerp_divides_the_angle(a, b, share) -> None:
    whole = q4.angle_between(a, b)
    between = q4.slerp(a, b, share)
    assert q4.angle_between(a, between) == pytest.approx(share * whole, abs=1e-6)
    assert q4.angle_between(between, b) == pytest.approx((1 - share) * whole, abs=1e-6)


@given(rotations, rotations)
def test_slerp_begins_and_ends_at_its_ends(a, b) -> None:
    assert same_rotation(q4.slerp(a, b, 0.0), a)
    assert same_rotation(q4.slerp(a, b, 1.0), b)


@given(rotations, rotations, shares)
def test_slerp_goes_the_short_way_whatever_the_signs(a, b, share) -> None:
    assume(abs(a @ b) > 1e-3)  # half a turn apart, both ways are equally short
    assert same_rotation(q4.slerp(a, b, share), q4.slerp(a, -b, share), 1e-6)


def test_slerp_between_nearly_equal_float32_is_exact() -> None:
    a = q4.IDENTITY
    b = q4.from_axis_angle([0, 1, 0], 1e-5).astype(np.float32)
    assert q4.slerp(a, b, 0.5).dtype == np.float32
    assert q4.angle_between(a, q4.slerp(a, b, 0.5)) == pytest.approx(0.5e-5, rel=1e-3)


def test_slerp_broadcasts_its_shares() -> None:
    a, b = np.tile(q4.IDENTITY, (5, 3, 1)), q4.from_axis_angle([0, 0, 1], np.full((5, 3), 1.0))
    turned = q4.slerp(a, b, np.linspace(0, 1, 5)[:, None])
    np.testing.assert_allclose(q4.angle_between(a, turned), np.linspace(0, 1, 5)[:, None] @ np.ones((1, 3)))


@given(rotations, st.lists(st.floats(0.1, 5), min_size=1, max_size=6))
def test_the_blend_of_one_rotation_is_that_rotation(q, weights) -> None:
    signs = np.array([1 if i % 2 else -1 for i in range(len(weights))])
    assert same_rotation(q4.blend(signs[:, None] * q, weights), q)


@given(rotations, rotations.map(lambda q: q4.slerp(q4.IDENTITY.astype(float), q, 0.3)))
def test_the_blend_of_two_with_equal_weights_is_the_middle(q, step) -> None:
    other = q4.multiply(q, step)
    assert same_rotation(q4.blend(np.stack([q, other]), [2.0, 2.0]), q4.slerp(q, other, 0.5), 1e-7)


def test_a_blend_stays_near_the_mean_of_a_turn() -> None:
    angles = np.radians([0.0, 10.0, 25.0, 40.0])
    weights = np.array([0.1, 0.4, 0.3, 0.2])
    blended = q4.blend(q4.from_axis_angle([1, 2, 3], angles), weights)
    assert np.degrees(q4.to_axis_angle(blended)[1]) == pytest.approx(np.degrees(weights @ angles), abs=0.1)


@given(rotations, rotations)
def test_the_angle_between_is_symmetric_and_ignores_signs(a, b) -> None:
    angle = q4.angle_between(a, b)
    assert 0 <= angle <= math.pi + 1e-12
    assert angle == pytest.approx(q4.angle_between(b, a), abs=1e-9)
    assert angle == pytest.approx(q4.angle_between(a, -b), abs=1e-9)
    traced = np.trace(q4.to_matrix(a).T @ q4.to_matrix(b))
    assert math.cos(angle) == pytest.approx((traced - 1) / 2, abs=1e-8)


def test_small_angles_survive_float32() -> None:
    q = q4.from_axis_angle([0, 0, 1], 1e-4).astype(np.float32)
    assert q4.angle_between(q4.IDENTITY, q) == pytest.approx(1e-4, rel=1e-3)


def test_normalize_gives_unit_length_and_the_identity_for_nothing() -> None:
    q = q4.normalize(np.array([[3.0, 0, 4.0, 0], [0, 0, 0, 0]]))
    np.testing.assert_allclose(q, [[0.6, 0, 0.8, 0], [1, 0, 0, 0]])


@given(rotations, rotations)
def test_aligned_keeps_the_rotation_and_takes_the_hemisphere(q, reference) -> None:
    turned = q4.aligned(q, reference)
    assert same_rotation(turned, q, 1e-15)
    assert turned @ reference >= 0


@pytest.mark.parametrize("axis", [0, 1])
def test_continuous_removes_sign_jumps_along_an_axis(axis: int) -> None:
    smooth = np.stack([q4.from_axis_angle([0, 1, 0], np.linspace(0, 12, 200)) for _ in range(3)])
    signs = np.random.default_rng(1).choice([-1.0, 1.0], size=(3, 200, 1))
    steps = np.moveaxis(smooth * signs, 1, axis)
    flat = np.moveaxis(q4.continuous(steps, axis), axis, 0)
    assert (np.sum(flat[1:] * flat[:-1], axis=-1) > 0.9).all()
    assert (np.abs(np.sum(flat * np.moveaxis(smooth, 1, 0), axis=-1)) > 1 - 1e-12).all()


def test_continuous_forgets_no_flip_after_a_right_angle() -> None:
    half = math.sqrt(0.5)
    steps = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [half, half, 0, 0], [-half, -half, 0, 0]])
    flat = q4.continuous(steps)
    assert (np.sum(flat[1:] * flat[:-1], axis=-1) >= 0).all()


@given(st.floats(-3.1, 3.1), st.floats(-1.4, 1.4))
def test_heading_is_the_turn_about_the_vertical(turn, tilt) -> None:
    about_y, about_x = q4.from_axis_angle([0, 1, 0], turn), q4.from_axis_angle([1, 0, 0], tilt)
    assert same_rotation(q4.heading(q4.multiply(about_y, about_x)), about_y)


@given(rotations, st.floats(-3.1, 3.1))
def test_turning_the_world_turns_the_heading(q, turn) -> None:
    assume(math.hypot(q[0], q[2]) > 1e-3)  # upside down there is none
    about_y = q4.from_axis_angle([0, 1, 0], turn)
    turned = q4.heading(q4.multiply(about_y, q))
    assert same_rotation(turned, q4.multiply(about_y, q4.heading(q)), 1e-6)
    assert turned[0] >= 0


def test_upside_down_has_no_heading() -> None:
    np.testing.assert_array_equal(q4.heading(np.array([0.0, 1, 0, 0])), q4.IDENTITY)


@given(rotations, rotations)
def test_sides_are_the_signs_that_align(q, reference) -> None:
    signs = q4.sides(np.stack([q, -q]), reference)
    assert signs.shape == (2, 1) and set(np.abs(signs).ravel()) == {1.0}
    if abs(np.dot(q, reference)) > 1e-9:
        for one in signs * np.stack([q, -q]):
            np.testing.assert_array_equal(one, q4.aligned(q, reference))


def test_functions_take_any_leading_shape_and_leave_their_arguments_alone() -> None:
    generator = np.random.default_rng(2)
    a, b = (q4.normalize(generator.normal(size=(2, 3, 5, 4)).astype(np.float32)) for _ in range(2))
    v = generator.normal(size=(2, 3, 5, 3)).astype(np.float32)
    before = a.copy(), b.copy(), v.copy()
    assert q4.multiply(a, b).shape == (2, 3, 5, 4)
    assert q4.rotate(a, v).shape == (2, 3, 5, 3)
    assert q4.to_matrix(a).shape == (2, 3, 5, 3, 3)
    assert q4.to_6d(a).shape == (2, 3, 5, 6)
    assert q4.slerp(a, b, 0.3).shape == (2, 3, 5, 4)
    assert q4.blend(a, [0.5, 0.5]).shape == (3, 5, 4)
    assert q4.angle_between(a, b).shape == (2, 3, 5)
    assert q4.heading(a).shape == (2, 3, 5, 4)
    for function in (q4.multiply(a, b), q4.slerp(a, b, 0.3), q4.normalize(a), q4.inverse(a)):
        assert function.dtype == np.float32
    for kept, now in zip(before, (a, b, v), strict=True):
        np.testing.assert_array_equal(kept, now)
