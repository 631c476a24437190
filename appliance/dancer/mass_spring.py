"""A mass-spring system: masses on a tree of bones, springs along them and towards their directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from appliance.dancer.slow_strings import SlowStrings

Vectors = NDArray[np.float64]  # (N, 3), world frame

SUBSTEPS = 10
SUBSTEP_S = 0.02 / SUBSTEPS
FASTEST_M_S = 30.0
# How far a bone may be stretched beyond its rest vector's length when a tick begins. A bound on velocities
# alone can feed a stretched spring: symplectic Euler keeps an energy with a term of position times velocity.
STRETCHED_M = 3.0
# A substep is stable while the frequency of the stiffest mode is below 2 / SUBSTEP_S. By Gershgorin's theorem
# a mass at the end of several bones is safe when the stiffness of each is below this share of mass / bones.
_STABLE = 0.5
_SHORTEST_M2 = 1e-12  # keeps two masses at one place from dividing by zero


class MassSpring:
    """N masses, each but the first tied to its parent; the first is the anchor, which only `step` moves.

    Forces on a mass at the bone b (its position less its parent's): the spring along it,
    -stiffness (|b| - length) b/|b|, and the spring towards the rest vector r, -directional (b - r); the
    parent gets their opposites, so that no momentum arises. Damping draws its velocity towards that of the
    flow around it. Semi-implicit (symplectic) Euler, the damping integrated exactly.

    carried (N,): newtons a metre that each bone's springs may have.
    positions, velocities (N, 3): metres, metres a second, world frame. rest (N, 3): rest vectors, metres.
    """

    def __init__(self, parents: Sequence[int], anchored: bool = True) -> None:
        """parents: of each node, before it in order; the first has none. anchored False: it moves freely."""
        count = len(parents)
        self.positions, self.velocities, self.rest = np.zeros((3, count, 3))
        self._parents, self._anchored = parents, anchored
        self._bones_of = np.eye(count)  # times positions: the bones; the first has none
        self._bones_of[0, 0] = 0.0
        for node, parent in enumerate(parents[1:], 1):
            self._bones_of[node, parent] = -1.0
        to_bones = self._bones_of.copy()
        to_bones[0, 0] = 1.0
        self._nodes_of = np.linalg.inv(to_bones)  # times bones: the positions; the first is one of both
        self._bones, self._push, self._drift = np.empty((3, count, 3))
        self._squares, self._pull = np.empty((2, count, 1))
        self.set_parameters(*(np.full(count, value) for value in (1.0, 1000.0, 100.0, 1.0)))

    def set_parameters(self, mass: Any, stiffness: Any, directional: Any, damping: Any) -> None:
        """All (N,): kilograms, newtons a metre twice, and the share of its velocity that a mass loses in a
        second, as a rate (1/s). Springs too stiff for the substep are made as stiff as it carries.
        """
        self.mass = np.asarray(mass, float)
        bones = np.count_nonzero(self._bones_of, axis=0)
        carried = _STABLE * self.mass / np.maximum(bones, 1) / SUBSTEP_S**2
        if self._anchored:
            carried[0] = np.inf
        most = np.minimum(carried, carried[np.maximum(self._parents, 0)])
        self.carried = np.minimum(most, 1e9)
        wanted = np.asarray(stiffness, float) + np.asarray(directional, float)
        share = np.minimum(1.0, most / np.maximum(wanted, 1e-9))
        self.stiffness, self.directional = stiffness * share, directional * share
        self.damping = np.asarray(damping, float)
        self._both = (self.stiffness + self.directional)[:, None]
        self._kept = np.exp(-self.damping * SUBSTEP_S)[:, None]
        self._pushes = (SUBSTEP_S**2 / self.mass)[:, None] * self._bones_of.T
        if self._anchored:
            self._kept[0], self._pushes[0] = 1.0, 0.0

    def begin(self, positions: Vectors) -> None:
        """Rest at these positions (N, 3)."""
        self.positions[:] = positions
        self.velocities[:] = 0.0

    def step(
        self, anchor: Vectors, flow: Vectors, acceleration: Vectors, strings: SlowStrings | None = None
    ) -> None:
        """One tick of 20 ms: the anchor moves evenly to (3,); flow (N, 3): velocity of what surrounds each
        mass, metres a second; acceleration (N, 3) or (3,): of gravity. `rest` is in force the whole tick.
        strings: those that the bones draw, and that pull them back.
        """
        positions, moves, bones = self.positions, self.velocities, self._bones
        lengths = np.sqrt(np.einsum("nk,nk->n", self.rest, self.rest))[:, None]
        tension, rest_pull = self.stiffness[:, None] * lengths, self.directional[:, None] * self.rest
        np.multiply(1.0 - self._kept, flow, out=self._drift)
        self._drift += SUBSTEP_S * acceleration
        if self._anchored:
            self._drift[0] = 0.0
            moves[0] = (anchor - positions[0]) / (SUBSTEPS * SUBSTEP_S)
        self._bound_stretch(lengths)
        np.maximum(moves, -FASTEST_M_S, out=moves)
        np.minimum(moves, FASTEST_M_S, out=moves)
        np.multiply(moves, SUBSTEP_S, out=moves)  # metres a substep: spares an operation in each
        np.multiply(self._drift, SUBSTEP_S, out=self._drift)
        for _ in range(SUBSTEPS):
            np.matmul(self._bones_of, positions, out=bones)
            np.einsum("nk,nk->n", bones, bones, out=self._squares[:, 0])
            np.add(self._squares, _SHORTEST_M2, out=self._squares)
            np.sqrt(self._squares, out=self._squares)
            np.divide(tension, self._squares, out=self._pull)
            np.subtract(self._pull, self._both, out=self._pull)
            np.multiply(bones, self._pull, out=bones)
            np.add(bones, rest_pull, out=bones)
            np.matmul(self._pushes, bones, out=self._push)
            np.multiply(moves, self._kept, out=moves)
            np.add(moves, self._push, out=moves)
            np.add(moves, self._drift, out=moves)
            if strings is not None:
                np.matmul(self._pushes, strings.pull(), out=self._push)
                np.add(moves, self._push, out=moves)
                np.matmul(self._bones_of, moves, out=bones)
                strings.follow(bones)
            np.add(positions, moves, out=positions)
        if strings is not None:
            strings.bound()
        np.divide(moves, SUBSTEP_S, out=moves)

    def _bound_stretch(self, lengths: NDArray[np.float64]) -> None:
        """Shortens bones that are stretched by more than STRETCHED_M; what hangs on them comes along."""
        np.matmul(self._bones_of, self.positions, out=self._bones)
        lasting = lengths + STRETCHED_M
        squares = np.einsum("nk,nk->n", self._bones, self._bones)[:, None]
        if np.all(squares <= lasting**2):
            return
        self._bones *= np.minimum(1.0, lasting / np.sqrt(np.maximum(squares, _SHORTEST_M2)))
        self._bones[0] = self.positions[0]
        np.matmul(self._nodes_of, self._bones, out=self.positions)

    def energy(self, gravity: Vectors | None = None) -> float:
        """Joules: of motion, of both kinds of springs, and in a field of gravity (3,), metres a second^2."""
        bones = self._bones_of @ self.positions
        stretch = np.linalg.norm(bones, axis=1) - np.linalg.norm(self.rest, axis=1)
        aside = np.sum((bones - self.rest) ** 2, axis=1)
        motion = self.mass @ np.sum(self.velocities**2, axis=1)
        height = 0.0 if gravity is None else float(self.mass @ (self.positions @ gravity))
        return float(motion + self.stiffness @ stretch**2 + self.directional @ aside) / 2 - height
