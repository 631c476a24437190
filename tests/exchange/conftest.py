"""Files in and out are tested with few figures."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from appliance.body import mesh_file
from appliance.exchange import glb_writing
from tests.known_surfaces import each_surface_once


@pytest.fixture(scope="session", autouse=True)
def _one_surface_a_figure() -> Iterator[None]:
    with each_surface_once(glb_writing, mesh_file):
        yield
