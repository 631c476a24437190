"""The coupled autoencoder: the compact default, and how far a held joint moves the rest of the body.

A plain autoencoder sees a held joint only as an unusual input among others, and learns to copy it with them.
Here a second network, the hand encoder, gives the mean latent of this dancer near a window while joints are
at given orientations. A hand moves the latent by a difference vector: that mean with the joints where the
hand wants them, less that mean with the joints where the phrase has them. The phrase's own part, the
residual, stays. So the answer keeps the dance's spread and energy whatever the hand asks for, and a hand
that holds a joint where the phrase has it changes nothing. A network that learns the answer itself by
distance gives the mean of all good ones instead, and the mean stands still (docs/notebook.md).

The hand encoder learns two thirds of what a hand changes, so its differences are too short. The effect on the
latent of putting the held joint into the window is known exactly; the rest, the body's share, counts more.

A hand may also want a joint at a place. The place encoder gives the mean latent while joints are at given
places, and each interaction adds a difference again: where the joint comes to lie depends on the whole chain
above it, so what is missing is looked at anew (once for all passes left a hand 10 cm off; anew, 2 cm).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appliance.dancer.blending import weights as shares_of_poses
from appliance.studio.autoencoder.networks import Mlp, Shape, TimeBasis
from appliance.studio.autoencoder.rotation import Bones, MovingSkeleton

STEP = 0.5  # share of the remaining way that one interaction takes: half of it at 2/1, 99.8 % at 10/9
HAND_WIDTH = 320
PLACE_WIDTH = 192
LONGEST_STEP = 0.5  # metres that one interaction asks of a joint at most
SMALLEST_SPREAD = 0.02  # metres; of the places of a joint that hardly moves
CALM = 0.6  # share of the residual that liveliness 0 keeps: as calm as the answers of release 0.1
BODY = 1.2  # gain of the body's share of a difference vector, which the hand encoder leaves out
LEARNED_BODY = 0.6  # the same in training: the critic works against the whole of it (docs/notebook.md)
NOISE = 0.25  # standard deviations of a latent, at liveliness 1

# A rotation matrix, row by row, from the products of a quaternion's components (w, x, y, z) x (w, x, y, z).
_PRODUCTS = (
    ({"ww": 1, "xx": 1, "yy": -1, "zz": -1}, {"xy": 2, "wz": -2}, {"xz": 2, "wy": 2}),
    ({"xy": 2, "wz": 2}, {"ww": 1, "xx": -1, "yy": 1, "zz": -1}, {"yz": 2, "wx": -2}),
    ({"xz": 2, "wy": -2}, {"yz": 2, "wx": 2}, {"ww": 1, "xx": -1, "yy": -1, "zz": 1}),
)


def matrix_of_products() -> Tensor:
    """(16, 9): maps the flat products of a unit quaternion's components to its flat rotation matrix."""
    table = torch.zeros(16, 9)
    for entry, products in enumerate(entry for row in _PRODUCTS for entry in row):
        for parts, factor in products.items():
            table[4 * "wxyz".index(parts[0]) + "wxyz".index(parts[1]), entry] = factor
    return table


class MeanLatent(nn.Module):
    """Three layers, the middle one residual: the mean latent (B, Z) for the known part of a window (B, S)."""

    def __init__(self, seen: int, width: int, latent: int) -> None:
        super().__init__()
        self.first = nn.Linear(seen, width)
        self.second = nn.Linear(width, width)
        self.last = nn.Linear(width, latent)

    def mean(self, seen: Tensor) -> Tensor:
        x = nn.functional.elu(self.first(seen))
        mean: Tensor = self.last(x + nn.functional.elu(self.second(x)))
        return mean


class HandEncoder(MeanLatent):
    """Mean latent near a latent while joints have given orientations."""

    def __init__(self, shape: Shape, width: int = HAND_WIDTH) -> None:
        super().__init__(shape.latent + shape.joints * (1 + 9 * shape.curves), width, shape.latent)
        self.time = TimeBasis(shape)
        self.matrix: Tensor
        self.register_buffer("matrix", matrix_of_products(), persistent=False)

    def forward(self, latent: Tensor, windows: Tensor, held: Tensor) -> Tensor:
        """(B, Z) near latents (B, Z), with the joints of windows (B, T, M, 4) that are held (B, M), 0 or 1.

        Orientations count as rotation matrices: without the double cover of quaternions, a hand that turns
        through whole revolutions never makes the input jump.
        """
        products = (windows[..., :, None] * windows[..., None, :]).flatten(-2)
        matrices = torch.matmul(products, self.matrix) * held[:, None, :, None]
        curves = torch.matmul(self.time.curves, matrices.flatten(2)).flatten(1)
        return self.mean(torch.cat([latent, curves, held], dim=-1))


class PlaceEncoder(MeanLatent):
    """Mean latent while joints are at given places; it knows the bones, and so where a window's joints are.

    Places: (B, M, 3) in metres from the root joint, axes of the heading-free window, mean of its poses by
    what each counts in prompt blending: so a joint is where the audience sees it (its plain mean put a hand
    3 cm off, this one 1.5 cm).
    """

    def __init__(self, shape: Shape, width: int = PLACE_WIDTH) -> None:
        joints = shape.joints
        super().__init__(4 * joints, width, shape.latent)
        self.parents: Tensor
        self.turns: Tensor
        self.reaches: Tensor
        self.middle: Tensor
        self.spread: Tensor
        self.register_buffer("parents", torch.full((joints,), -1))
        self.register_buffer("turns", torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(joints, 1))
        self.register_buffer("reaches", torch.zeros(joints, 3))
        self.register_buffer("middle", torch.zeros(joints, 3))
        self.register_buffer("spread", torch.ones(joints, 1))
        shares = torch.from_numpy(shares_of_poses(shape.window, 1, "prompt"))
        self.shown: Tensor
        self.register_buffer("shown", shares / shares.sum(), persistent=False)

    @property
    def bones(self) -> Bones:
        """The moving joints' bones; until `set_bones` they have no length, and every place is the root's."""
        return Bones(self.parents.tolist(), self.turns, self.reaches)

    @torch.no_grad()
    def set_bones(self, bones: Bones) -> None:
        self.parents.copy_(torch.tensor(bones.parents))
        self.turns.copy_(bones.turns)
        self.reaches.copy_(bones.reaches)

    @torch.no_grad()
    def measure(self, places: Tensor) -> None:
        """Scale the input by the dancer's own places (B, M, 3)."""
        self.middle.copy_(places.mean(0))
        self.spread.copy_(places.std(0).mean(-1, keepdim=True).clamp_min(SMALLEST_SPREAD))

    def where(self, windows: Tensor) -> Tensor:
        """Places (B, M, 3) of windows (B, T, M, 4)."""
        return self.seen(MovingSkeleton(self.bones)(windows))

    def seen(self, positions: Tensor) -> Tensor:
        """(B, M, 3) of the positions in each pose (B, T, M, 3)."""
        return torch.einsum("t,btmc->bmc", self.shown, positions)

    def forward(self, places: Tensor, held: Tensor) -> Tensor:
        """(B, Z) for the joints of places (B, M, 3) that are held (B, M), 0 or 1."""
        seen = (places - self.middle) / self.spread * held[..., None]
        return self.mean(torch.cat([seen.flatten(1), held], dim=-1))


class Coupled(Mlp):
    """The mlp with a hand encoder and a place encoder."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.hands = HandEncoder(shape)
        self.places = PlaceEncoder(shape)

    @torch.no_grad()
    def standardise(self, mean: Tensor, deviation: Tensor) -> None:
        super().standardise(mean, deviation)
        size = len(mean)
        first = self.hands.first
        first.bias.add_(first.weight[:, :size] @ mean)
        first.weight[:, :size] *= deviation
        for last in (self.hands.last, self.places.last):
            last.weight /= deviation[:, None]
            last.bias.sub_(mean).div_(deviation)

    def difference(self, latent: Tensor, start: Tensor, goal: Tensor, held: Tensor) -> tuple[Tensor, Tensor]:
        """(B, Z) each: the mean latents near latents (B, Z) with the joints that are held (B, M), 0 or 1, as
        in windows goal (B, T, M, 4), and as in windows start.
        """
        return self.hands(latent, goal, held), self.hands(latent, start, held)

    def pull(
        self,
        latents: tuple[Tensor, Tensor],
        start: Tensor,
        goal: Tensor,
        held: Tensor,
        liveliness: Tensor,
        noise: Tensor,
        more_of_the_body: float = BODY,
    ) -> Tensor:
        """(B, Z): what all interactions together add to the latents of windows start (B, T, M, 4).

        goal (B, T, M, 4): start with the joints that are held (B, M), 0 or 1, where the hands want them;
        latents (B, Z): of start and of goal; liveliness (B): the share of the residual that stays grows with
        it from CALM to 1; noise (B, Z).
        """
        latent, pasted = latents
        there, here = self.difference(latent, start, goal, held)
        way = there - here
        body = way - (pasted - latent)
        lively = liveliness[:, None]
        residual = (1 - CALM) * (lively - 1) * (latent - here)
        whole = way + more_of_the_body * body + residual + NOISE * lively * noise
        pull: Tensor = held.amax(dim=1, keepdim=True) * whole
        return pull

    def step_to_places(self, windows: Tensor, places: Tensor, weights: Tensor) -> Tensor:
        """(B, Z): what one interaction adds to the latents of heading-free windows (B, T, M, 4).

        weights (B, M), 0 to 1: the share of the way to places (B, M, 3) that this one takes; at most
        LONGEST_STEP of the way counts, so that a place out of reach strains the body less.
        """
        here, held = self.places.where(windows), (weights > 0).float()
        way = places - here
        length = way.norm(dim=-1, keepdim=True)
        there = here + weights[..., None] * LONGEST_STEP / length.clamp_min(LONGEST_STEP) * way
        step: Tensor = self.places(there, held) - self.places(here, held)
        return held.amax(dim=1, keepdim=True) * step


def share_of_pass(number: int) -> float:
    """Share of the pull that interaction `number`, from 0, adds."""
    return STEP * (1 - STEP) ** number
