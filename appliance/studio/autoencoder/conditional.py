"""The conditional autoencoder: the compact default, conditioned on the held joints and the phrase.

A plain autoencoder sees a held joint only as an unusual input among others, and learns to copy it with them.
This one removes the held joints from the window and takes their targets as rotation matrices instead, one for
each pose: without the double cover of quaternions, a hand that turns through whole revolutions never makes
the input jump. Its second condition is the window with which the iteration began: the answer starts from the
phrase, and further iterations do not forget the phrase's own gestures. The condition is computed once for
each window, so iterations cost no more: it is the bias of the first layer and, for gestures that a latent of
64 numbers would smooth away, of the last. A pass without held joints has no condition: it is a plain
autoencoder.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appliance.studio.autoencoder.networks import Mlp, MlpDecoder, MlpEncoder, Shape

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


class ConditionalEncoder(MlpEncoder):
    """The encoder of an mlp with a condition: the targets of the held joints, and the first window."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.shape = shape
        told = shape.joints * (1 + shape.curves * (9 + 4))
        self.told = nn.Linear(told, shape.width, bias=False)
        self.matrix: Tensor
        self.register_buffer("matrix", matrix_of_products(), persistent=False)

    def condition(self, start: Tensor, targets: Tensor, held: Tensor) -> Tensor:
        """Bias (B, W) of the first layer from first window and targets (B, T, M, 4), held by (B, M)."""
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


class ConditionalDecoder(MlpDecoder):
    """The decoder of an mlp with a condition: the window with which the iteration began."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.phrase = nn.Linear(shape.curves * shape.pose, shape.curves * shape.pose, bias=False)
        nn.init.zeros_(self.phrase.weight)

    def condition(self, start: Tensor, held: Tensor) -> Tensor:
        """Bias (B, C * P) of the last layer from the first window, held by (B, M)."""
        strongest = held.amax(dim=1, keepdim=True)
        condition: Tensor = strongest * self.phrase(self.time.project(start.flatten(1)))
        return condition

    def forward(self, latent: Tensor, condition: Tensor | None = None) -> Tensor:
        amounts: Tensor = self.stack(latent)
        return self.time.unfold(amounts if condition is None else amounts + condition)


class Conditional(Mlp):
    """The mlp conditioned on the held joints and, while any is held, on the first window."""

    encoder: ConditionalEncoder
    decoder: ConditionalDecoder

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape)
        self.encoder, self.decoder = ConditionalEncoder(shape), ConditionalDecoder(shape)

    def encode_held(self, window: Tensor, held: Tensor, condition: Tensor) -> Tensor:
        """Latents (B, Z) of windows without the joints that are held by (B, M); condition: the encoder's."""
        left = (window * (1 - held)[:, None, :, None]).flatten(1)
        latent: Tensor = self.encoder(left, condition)
        return latent

    def decode_held(self, latent: Tensor, condition: Tensor) -> Tensor:
        """Latents (B, Z) of encode_held -> flat windows; condition: the decoder's."""
        window: Tensor = self.decoder(latent, condition)
        return window
