"""Universes that no symmetry hides a fault in, and waiting for what another thread does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

from appliance.show.dmx import DmxConfig

PATIENCE_S = 60.0


def universe(seed: int = 0) -> bytes:
    """512 levels, each different from its neighbours."""
    return bytes((seed + 7 * place + place // 256) % 256 for place in range(512))


def config(wire: str, **keys: Any) -> DmxConfig:
    """An entry of the box file."""
    return DmxConfig.model_validate({"universe": 1, "wire": wire, **keys})


@pytest.fixture
def until() -> Callable[[Callable[[], bool]], None]:
    """until(lambda: ...) waits for what has to become true; the time limit is for a broken program alone."""

    def wait(is_so: Callable[[], bool]) -> None:
        give_up = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < give_up, "it does not become true"
            time.sleep(0.002)

    return wait
