"""The tick's SLERP is the SLERP of appliance.pose."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from appliance.dancer.slerp import Slerp
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions


@given(st.integers(0, 2**32 - 1))
def test_agrees_with_the_poses_slerp_for_any_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_quaternions(rng, 2, 50)
    b[:10] = a[:10]
    b[10:20] = -a[10:20]
    b[20:30] = quaternion.normalize(a[20:30] + 1e-4 * b[20:30])
    t = rng.uniform(0, 1, 50).astype(np.float32)
    out = np.empty((50, 4), dtype=np.float32)
    Slerp(50)(a, b, t, out)
    expected = quaternion.slerp(a.astype(np.float64), b.astype(np.float64), t)
    assert np.abs(out - expected).max() < 2e-6


def test_ends_are_exact_and_lie_in_the_first_ones_hemisphere() -> None:
    a, b = random_quaternions(np.random.default_rng(1), 2, 40)
    out = np.empty_like(a)
    Slerp(40)(a, b, 0.0, out)
    assert np.allclose(out, a, atol=1e-7)
    Slerp(40)(a, b, 1.0, out)
    assert np.allclose(out, quaternion.aligned(b, a), atol=1e-7)


def test_may_write_into_its_first_argument() -> None:
    a, b = random_quaternions(np.random.default_rng(2), 2, 40)
    expected = quaternion.slerp(a, b, np.float32(0.3))
    Slerp(40)(a, b, 0.3, a)
    assert np.allclose(a, expected, atol=1e-6)
