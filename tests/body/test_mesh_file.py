"""The body's surface in a bundle is the one that would be modelled; any other file is passed over."""

from __future__ import annotations

import random
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from appliance.body import mesh_file
from appliance.body.body_mesh import body_mesh
from appliance.body.mesh_file import MESH_FILE, mesh_of_show, read_mesh, write_mesh
from appliance.body.skinning import BodyMesh
from appliance.pose.skeleton import Skeleton
from appliance.projector.picture import body_buffers
from appliance.projector.picture.vertices import packed
from appliance.show.bundle import bundled_shows
from appliance.show.show import load_show
from tests.bundles import write_show
from tests.command import Command
from tests.projector import skeletons


@pytest.fixture
def toy(tmp_path: Path) -> Skeleton:
    """A skeleton whose surface is in tmp_path."""
    skeleton = skeletons.toy()
    assert write_mesh(tmp_path, skeleton) and not write_mesh(tmp_path, skeleton)
    return skeleton


def sent(mesh: BodyMesh) -> list[Any]:
    """A surface as a GPU gets it: vertices and indices, fine and coarse."""
    gpu: Any = SimpleNamespace(buffer=bytes)
    buffers = body_buffers.BodyBuffers(gpu, mesh)
    return [buffers.content(coarse) for coarse in (False, True)]


def assert_baked_as_today(mesh: BodyMesh) -> None:
    """The file has every byte that the projector would compute from the surface in it."""
    assert mesh.baked is not None and sent(mesh) == sent(replace(mesh, baked=None))


@pytest.mark.parametrize("name", skeletons.ALL)
def test_a_gpu_gets_from_the_file_what_it_gets_from_the_model(name: str, tmp_path: Path) -> None:
    skeleton = skeletons.ALL[name]()
    write_mesh(tmp_path, skeleton)
    found, modelled = read_mesh(tmp_path, skeleton), body_mesh(skeleton)
    assert found is not None
    for part in ("faces", "joints", "bind_positions", "bind_world", "height"):
        np.testing.assert_array_equal(getattr(found, part), getattr(modelled, part))
    extent = float(np.ptp(modelled.vertices, axis=0).max())
    np.testing.assert_allclose(found.vertices, modelled.vertices, atol=extent / 65535)
    parts = [packed({"normal": one.normals, "weights": one.weights}) for one in (found, modelled)]
    assert parts[0] == parts[1]
    assert_baked_as_today(found)


@pytest.mark.parametrize("show", bundled_shows().values(), ids=bundled_shows())
def test_bundled_shows_have_the_surface_that_is_modelled_today(show: Path) -> None:
    """If it fails after a change of the body or of bake.py: raise MODEL, then `bunraku pack` both shows."""
    skeleton = load_show(show).skeleton
    found, modelled = read_mesh(show, skeleton), body_mesh(skeleton)
    assert found is not None
    assert (show / MESH_FILE).stat().st_size < 400_000
    assert_baked_as_today(found)
    assert found.vertices.shape == modelled.vertices.shape
    np.testing.assert_allclose(found.vertices, modelled.vertices, atol=1e-3)
    assert (found.faces == modelled.faces).all(axis=1).mean() > 0.99


def test_a_show_with_its_surface_is_not_modelled(
    toy: Skeleton, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    monkeypatch.setattr(mesh_file, "body_mesh", lambda skeleton: made.append(skeleton) or body_mesh(skeleton))
    monkeypatch.setattr(body_buffers, "bake", lambda mesh: pytest.fail("computed at the start"))
    sent(mesh_of_show(toy, tmp_path))
    assert not made
    mesh_of_show(toy, tmp_path / "none")
    mesh_of_show(toy, None)
    assert made == [toy, toy]


def test_the_surface_of_another_skeleton_or_of_another_model_is_made_again(
    toy: Skeleton, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    longer = replace(toy, offsets=1.1 * toy.offsets)
    assert read_mesh(tmp_path, longer) is None
    assert mesh_of_show(longer, tmp_path).height == body_mesh(longer).height
    monkeypatch.setattr(mesh_file, "MODEL", mesh_file.MODEL + 1)
    assert read_mesh(tmp_path, toy) is None
    assert write_mesh(tmp_path, toy) and read_mesh(tmp_path, toy) is not None


def test_a_surface_of_more_joints_than_a_byte_counts_follows_each_of_them(tmp_path: Path) -> None:
    rope = skeletons.rope(300)
    write_mesh(tmp_path, rope)
    found = read_mesh(tmp_path, rope)
    assert found is not None and int(found.joints.max()) == 299
    away = found.vertices - found.bind_positions[found.joints[:, 0]]
    assert np.abs(away).max() < 0.5 and found.height == pytest.approx(3.0)


def test_a_damaged_file_never_stops_the_projector(toy: Skeleton, tmp_path: Path, rng: random.Random) -> None:
    file = tmp_path / MESH_FILE
    whole = file.read_bytes()
    for _ in range(200):
        spoilt = bytearray(whole[: rng.randrange(len(whole))] if rng.random() < 0.3 else whole)
        for _ in range(rng.randrange(1, 9)):
            if spoilt:
                spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
        file.write_bytes(spoilt)
        found = read_mesh(tmp_path, toy)
        assert found is None or (found.faces.max() < len(found.vertices) and found.joints.max() < len(toy))


def test_wrong_numbers_in_a_sound_archive_are_refused(toy: Skeleton, tmp_path: Path) -> None:
    file = tmp_path / MESH_FILE
    with np.load(file) as loaded:
        whole = {name: loaded[name] for name in loaded.files}
    wrong = {
        "quads": whole["quads"] ^ 64,
        "joints": whole["joints"] + np.uint8(len(toy)),
        "bind_positions": whole["bind_positions"] * np.float32("nan"),
        "bind_world": whole["bind_world"][:-1],
        "normals": whole["normals"][:, 1:],
        "weights": whole["weights"].astype(float)[:3],
        "height": np.zeros(2),
        "open": whole["open"][1:],
        "sunk": whole["sunk"] * np.float16("nan"),
        "calm": whole["calm"][:2],
        "order": whole["order"][:, 1:],
    }
    for name, value in wrong.items():
        np.savez_compressed(file, **(whole | {name: value}))
        assert read_mesh(tmp_path, toy) is None, name


def test_an_archive_that_would_fill_the_memory_is_not_unpacked(toy: Skeleton, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / MESH_FILE, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("key.npy", bytes(64_000_000))
    assert read_mesh(tmp_path, toy) is None
    (tmp_path / MESH_FILE).unlink()
    (tmp_path / MESH_FILE).symlink_to("/dev/zero")
    assert read_mesh(tmp_path, toy) is None


def test_check_says_that_the_surface_is_missing_and_pack_writes_it(tmp_path: Path, bunraku: Command) -> None:
    show = write_show(tmp_path / "mine")
    bunraku("pack", show)
    assert MESH_FILE not in bunraku("check", show).out
    (show / MESH_FILE).unlink()
    (show / "SHA256SUMS").write_text(
        "".join(line for line in (show / "SHA256SUMS").read_text().splitlines(True) if MESH_FILE not in line)
    )
    assert bunraku("check", show).out.count(f"no {MESH_FILE} for this skeleton") == 1
    bunraku("pack", show)
    assert MESH_FILE not in bunraku("check", show).out
