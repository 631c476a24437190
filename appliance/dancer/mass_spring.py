"""A mass-spring system: masses on a tree of bones, springs along them and towards their directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from appliance.dancer.slow_strings import SlowStrings

Vectors = NDArray[np.float64]  # (N, 3), world frame
Floats = NDArray[np.float64]  # (N,)

SUBSTEPS = 10
SUBSTEP_S = 0.02 / SUBSTEPS
FASTEST_M_S = 30.0
# How far a bone may be stretched beyond its rest vector's length when a tick begins. A bound on velocities is
# not enough and can feed a stretched spring: symplectic Euler keeps an energy with a term of position times
# velocity.
STRETCHED_M = 3.0
SHORTENED_M = 2.0  # how far it then is: at the bound itself, stiff light chains shook for ever
# A substep is stable while the frequency of the stiffest mode is below 2 / SUBSTEP_S. By Gershgorin's theorem
# a mass at the end of several bones is safe when the stiffness of each is below 1 / SUBSTEP_S^2 times mass /
# bones. At this share of it swings through a bone's own start die away as well: at 0.2 some went on for ever.
_STABLE = 0.1
_SHORTEST_M = 1e-6  # keeps a bone without length from dividing by zero


class MassSpring:
    """N masses, each but the first tied to its parent; the first is the anchor, which only `step` moves.

    Forces on a mass at the bone b (its position less its parent's): the spring along it,
    -stiffness (|b| - length) b/|b|, and the spring towards the rest vector r, -directional (b - r); the
    parent gets their opposites, so that no momentum arises. A bone shorter than half its length is pushed by
    stiffness b: the force has no edge where both masses are at one place, which gave fast masses more energy
    than damping took. Damping draws its velocity towards that of the
    flow around it. Semi-implicit (symplectic) Euler, the damping integrated exactly.

    carried (N,): newtons a metre that each bone's springs may have.
    positions, velocities (N, 3): metres, metres a second, world frame. rest (N, 3): rest vectors, metres.
    """

    SNAPSHOT = ("positions", "velocities")

    def __init__(self, parents: Sequence[int], anchored: bool = True) -> None:
        """parents: of each node, before it in order; the first has none. anchored False: it moves freely."""
        count = len(parents)
        self.positions, self.velocities, self.rest = np.zeros((3, count, 3))
        self._anchored, self._above = anchored, np.maximum(parents, 0)
        # Times positions: the bones, and in the place of the first node's its own position.
        self._bones_of = np.eye(count)
        for node, parent in enumerate(parents[1:], 1):
            self._bones_of[node, parent] = -1.0
        self._nodes_of = np.linalg.inv(self._bones_of)  # times these: the positions
        self._to_bones = self._bones_of.copy()  # only the bones
        self._to_bones[0, 0] = 0.0
        # Newtons a metre that each bone's springs may have for each kilogram at its end.
        self._carried_by = _STABLE / np.maximum(np.count_nonzero(self._to_bones, axis=0), 1) / SUBSTEP_S**2
        if anchored:
            self._carried_by[0] = 1e9
        self._pushes = np.empty((count, count))
        self._bones, self._force, self._push, self._drift, self._kept = np.empty((5, count, 3))
        self._pull = np.empty((count, 1))
        self.set_parameters(*(np.full(count, value) for value in (1.0, 1000.0, 100.0, 1.0)))

    def set_parameters(self, mass: Floats, stiffness: Floats, directional: Floats, damping: Floats) -> None:
        """All (N,): kilograms, newtons a metre twice, and the share of its velocity that a mass loses in a
        second, as a rate (1/s). Springs too stiff for the substep are made as stiff as it carries.
        """
        self.mass, self.damping = mass, damping
        carried = self._carried_by * mass
        self.carried = np.minimum(carried, carried[self._above])
        share = self.carried / np.maximum(stiffness + directional, self.carried)
        self.stiffness, self.directional = stiffness * share, directional * share
        self._both = (self.stiffness + self.directional)[:, None]
        self._kept[:] = np.exp(-SUBSTEP_S * damping)[:, None]
        np.multiply((SUBSTEP_S**2 / mass)[:, None], self._to_bones.T, out=self._pushes)
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
        moves, bones, force, push, drift = self.velocities, self._bones, self._force, self._push, self._drift
        add, multiply, matmul, kept, pull = np.add, np.multiply, np.matmul, self._kept, self._pull
        lengths = np.sqrt(np.vecdot(self.rest, self.rest))[:, None]
        halves = np.maximum(lengths / 2, _SHORTEST_M)
        tension, rest_pull = self.stiffness[:, None] * lengths, self.directional[:, None] * self.rest
        multiply(1.0 - kept, flow, out=drift)
        drift += SUBSTEP_S * acceleration
        if self._anchored:
            drift[0] = 0.0
            moves[0] = (anchor - self.positions[0]) / (SUBSTEPS * SUBSTEP_S)
        matmul(self._bones_of, self.positions, out=bones)
        self._bound_stretch(lengths)
        np.maximum(moves, -FASTEST_M_S, out=moves)
        np.minimum(moves, FASTEST_M_S, out=moves)
        moves *= SUBSTEP_S  # metres a substep: spares an operation in each
        drift *= SUBSTEP_S
        for _ in range(SUBSTEPS):
            np.vecdot(bones, bones, out=pull[:, 0])
            np.sqrt(pull, out=pull)
            np.maximum(pull, halves, out=pull)
            np.divide(tension, pull, out=pull)
            np.subtract(pull, self._both, out=pull)
            multiply(bones, pull, out=force)
            add(force, rest_pull, out=force)
            if strings is not None:
                add(force, strings.pull(), out=force)
            matmul(self._pushes, force, out=push)
            multiply(moves, kept, out=moves)
            add(moves, push, out=moves)
            add(moves, drift, out=moves)
            matmul(self._bones_of, moves, out=push)
            add(bones, push, out=bones)
            if strings is not None:
                strings.follow(push)
        if strings is not None:
            strings.bound()
        matmul(self._nodes_of, bones, out=self.positions)
        moves /= SUBSTEP_S

    def _bound_stretch(self, lengths: NDArray[np.float64]) -> None:
        """Shortens bones that are stretched by more than STRETCHED_M; what hangs on them comes along."""
        squares = np.vecdot(self._bones, self._bones)[:, None]
        stretched = squares > (lengths + STRETCHED_M) ** 2
        stretched[0] = False  # is no bone
        if stretched.any():
            shortened = (lengths + SHORTENED_M) / np.sqrt(np.maximum(squares, _SHORTEST_M))
            self._bones *= np.where(stretched, shortened, 1.0)

    def energy(self, gravity: Vectors | None = None) -> float:
        """Joules: of motion, of both kinds of springs, and in a field of gravity (3,), metres a second^2."""
        bones = self._to_bones @ self.positions
        far, lengths = np.linalg.norm(bones, axis=1), np.linalg.norm(self.rest, axis=1)
        squares = np.where(far < lengths / 2, lengths**2 / 2 - far**2, (far - lengths) ** 2)
        aside = np.sum((bones - self.rest) ** 2, axis=1)
        motion = self.mass @ np.sum(self.velocities**2, axis=1)
        height = 0.0 if gravity is None else float(self.mass @ (self.positions @ gravity))
        return float(motion + self.stiffness @ squares + self.directional @ aside) / 2 - height
