"""Strands of the look lines: they cover the body and end where it ends."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.body.body_mesh import body_mesh
from appliance.pose.recording import Recording
from appliance.projector.picture.body_buffers import BodyBuffers
from appliance.projector.picture.particles import traced
from appliance.projector.picture.strands import OFF, POINTS, ribbons_of


def test_no_strand_runs_on_beyond_a_finger_or_the_head(dance: Recording, gl: moderngl.Context) -> None:
    mesh = body_mesh(dance.skeleton)
    body = BodyBuffers(gl, mesh)
    parts, _, count = ribbons_of(body, dance.skeleton, mesh.bind_positions / mesh.height)
    body.release()
    shown = parts["along"][::2, 1] > 0.0
    assert count > 100 and shown.mean() > 0.4 and len(shown) == count * (POINTS + 1)
    off = [
        np.linalg.norm(body.positions - place, axis=1).min() for place in parts["position"][::2][shown][::3]
    ]
    assert max(off) < OFF


def test_the_head_is_closed(dance: Recording, gl: moderngl.Context) -> None:
    """Each place of the crown has a strand near by, of those that a look draws without its own density."""
    mesh = body_mesh(dance.skeleton)
    body = BodyBuffers(gl, mesh)
    parts, _, count = ribbons_of(body, dance.skeleton, mesh.bind_positions / mesh.height)
    body.release()
    drawn = slice(0, round(0.6 * count) * (POINTS + 1))
    strands = parts["position"][::2][drawn][parts["along"][::2, 1][drawn] > 0.5]
    crown = body.positions[body.positions[:, 1] > body.positions[:, 1].max() - 0.05]
    off = np.linalg.norm(crown[:, None] - strands[None], axis=2).min(axis=1)
    assert len(crown) > 100 and np.quantile(off, 0.9) < 0.018


def test_only_the_ends_of_limbs_leave_trails(dance: Recording, gl: moderngl.Context) -> None:
    """A trail of a shin is a dash across the leg."""
    mesh = body_mesh(dance.skeleton)
    body = BodyBuffers(gl, mesh)
    points = traced(body, dance.skeleton, mesh.bind_positions / mesh.height, 56)
    body.release()
    moved_by = {dance.skeleton.names[joint] for joint in points["joints"][:, 0]}
    assert {"lHand", "rHand", "lFoot", "rFoot"} & moved_by
    assert not moved_by & {"lShin", "rShin", "lThigh", "rThigh", "lForeArm", "rForeArm", "chest", "neck"}
