"""Figures that are alike share one surface, which takes a second to work out. tests/body tests it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from types import ModuleType

import pytest

from appliance.body.body_mesh import BodyMesh, body_mesh
from appliance.body.mesh_file import mesh_key
from appliance.pose.skeleton import Skeleton


@contextlib.contextmanager
def each_surface_once(*modules: ModuleType) -> Iterator[None]:
    """These modules, which import body_mesh, get the surface that an earlier figure like it had."""
    known: dict[str, BodyMesh] = {}

    def surface(skeleton: Skeleton) -> BodyMesh:
        key = mesh_key(skeleton)
        if key not in known:
            known[key] = body_mesh(skeleton)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        for module in modules:
            patch.setattr(module, "body_mesh", surface)
        yield
