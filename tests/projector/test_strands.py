"""Strands of the look lines: they cover the body and end where it ends."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.body.body_mesh import body_mesh
from appliance.pose.recording import Recording
from appliance.projector.picture.body_buffers import BodyBuffers
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
