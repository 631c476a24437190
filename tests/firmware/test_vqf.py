"""The core's fusion against the authors' program: ten minutes of made motion."""

from __future__ import annotations

import ctypes
import json

import numpy as np
import pytest
from numpy.typing import NDArray

from hw_sim.firmware_library import load_library
from tests.firmware import made_motion
from tests.firmware.made_motion import EVERY, GOLDEN, GOLDEN_EVERY_S, RATE_HZ, Floats

APART_DEGREES = 0.02  # single precision against double; a degree would be felt

Measured = tuple[Floats, Floats]


@pytest.fixture(scope="module")
def measured() -> Measured:
    return made_motion.measured()


@pytest.fixture(scope="module")
def by_the_core(measured: Measured) -> Floats:
    rates, accelerations = (np.ascontiguousarray(each, dtype=np.float32) for each in measured)
    orientations = np.empty((len(rates), 4), dtype=np.float32)
    run = load_library().vqf_run
    run.restype = None

    def at(values: NDArray[np.float32]) -> ctypes.c_void_p:
        return ctypes.c_void_p(values.ctypes.data)

    run(at(rates), at(accelerations), len(rates), ctypes.c_float(1 / RATE_HZ), EVERY, at(orientations))
    return orientations.astype(np.float64)


def degrees_apart(one: Floats, other: Floats) -> Floats:
    one, other = (each / np.linalg.norm(each, axis=1)[:, None] for each in (one, other))
    across = np.minimum(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1))
    apart: Floats = np.degrees(4 * np.arcsin(np.clip(across / 2, 0, 1)))
    return apart


def test_it_says_what_the_authors_program_said(by_the_core: Floats) -> None:
    golden = np.array(json.loads(GOLDEN.read_text())["orientations"])
    said = by_the_core[:: GOLDEN_EVERY_S * RATE_HZ]
    assert len(said) == len(golden) == made_motion.MINUTES * 60 // GOLDEN_EVERY_S
    assert degrees_apart(said, golden).max() < APART_DEGREES


def test_it_says_what_the_authors_program_says_at_every_sample(
    measured: Measured, by_the_core: Floats
) -> None:
    pytest.importorskip("vqf", reason="the authors' program is not installed")
    assert degrees_apart(by_the_core, made_motion.by_the_authors(*measured)).max() < APART_DEGREES


def test_gravity_alone_would_not_pass(measured: Measured, by_the_core: Floats) -> None:
    """Accelerations of a dance point elsewhere than up: the laziest fusion is far from this one."""
    _, accelerations = measured
    up = accelerations / np.linalg.norm(accelerations, axis=1)[:, None]
    w, x, y, z = by_the_core[EVERY - 1 :: EVERY].T
    fused_up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    apart = np.degrees(np.arccos(np.clip((up * fused_up).sum(axis=1), -1, 1)))
    assert np.median(apart) > 5 * APART_DEGREES
