"""The conditional autoencoder: the compact default, told which joints are held and how.

A plain autoencoder sees a held joint only as an odd number among its inputs, and learns to copy it with the
rest. This one takes the held joints out of the window and sees their targets as rotation matrices instead:
one for each pose, without the double cover of quaternions, so that a hand that turns through whole
revolutions never makes its input jump. Beside them it sees the window that the iteration began with: the
phrase is where the answer starts from, and however often it is coded, its own gestures are not forgotten.
What it is told costs the iteration nothing: it is computed once for a window and enters as the bias of the
first layer. A pass in which nothing is held is told nothing.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appliance.studio.autoencoder.networks import Mlp, MlpEncoder, Shape

# A rotation matrix, row by row, from the products of a quaternion's parts (w, x, y, z) x (w, x, y, z).
_PRODUCTS = (
    ({"ww": 1, "xx": 1, "yy": -1, "zz": -1}, {"xy": 2, "wz": -2}, {"xz": 2, "wy": 2}),
    ({"xy": 2, "wz": 2}, {"ww": 1, "xx": -1, "yy": 1, "zz": -1}, {"yz": 2, "wx": -2}),
    ({"xz": 2, "wy": -2}, {"yz": 2, "wx": 2}, {"ww": 1, "xx": -1, "yy": -1, "zz": 1}),
)


def matrix_of_products() -> Tensor:
    """(16, 9): products of the parts of a unit quaternion, flat, to its rotation matrix, flat."""
    table = torch.zeros(16, 9)
    for entry, products in enumerate(entry for row in _PRODUCTS for entry in row):
        for parts, factor in products.items():
            table[4 * "wxyz".index(parts[0]) + "wxyz".index(parts[1]), entry] = factor
    return table


class ConditionalEncoder(MlpEncoder):
    """The encoder of an mlp with one more input: the targets of the held joints."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.shape = shape
        told = shape.joints * (1 + shape.curves * (9 + 4))
        self.told = nn.Linear(told, shape.width, bias=False)
        self.matrix: Tensor
        self.register_buffer("matrix", matrix_of_products(), persistent=False)

    def condition(self, start: Tensor, targets: Tensor, held: Tensor) -> Tensor:
        """What the first layer adds (B, W) for the first window and targets (B, T, M, 4), held by (B, M)."""
        products = (targets[..., :, None] * targets[..., None, :]).flatten(-2)
        matrices = torch.matmul(products, self.matrix) * held[:, None, :, None]
        curves = torch.matmul(self.time.curves, matrices.flatten(2)).flatten(1)
        phrase = self.time.project(start.flatten(1)) * held.amax(dim=1, keepdim=True)
        condition: Tensor = self.told(torch.cat([curves, held, phrase], dim=-1))
        return condition

    def forward(self, window: Tensor, condition: Tensor | None = None) -> Tensor:
        first = self.stack[0](self.time.project(window))
        latent: Tensor = self.stack[1:](first if condition is None else first + condition)
        return latent


class Conditional(Mlp):
    """The mlp whose encoder knows the held joints."""

    encoder: ConditionalEncoder

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.encoder = ConditionalEncoder(shape)

    def encode_held(self, window: Tensor, start: Tensor, targets: Tensor, held: Tensor) -> Tensor:
        """Latents (B, Z) of windows whose joints give way to targets (B, T, M, 4) by held (B, M)."""
        left = (window * (1 - held)[:, None, :, None]).flatten(1)
        latent: Tensor = self.encoder(left, self.encoder.condition(start, targets, held))
        return latent
