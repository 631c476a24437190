"""The dance and the context that the tests of the looks share."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest

from appliance.pose.recording import Recording
from appliance.projector.context import offscreen
from appliance.projector.picture.renderer import Renderer
from tests.projector.golden_looks import SIZE, phrase, renderer


@pytest.fixture(scope="module")
def dance() -> Recording:
    return phrase()


@pytest.fixture(scope="module")
def gl() -> Iterator[moderngl.Context]:
    with offscreen(SIZE) as context:
        yield context


@pytest.fixture(scope="module")
def looks(gl: moderngl.Context, dance: Recording) -> Iterator[Renderer]:
    with renderer(gl, dance.skeleton) as made:
        yield made
