"""The pose autoencoder as 'Beyond Imitation' published it."""

from __future__ import annotations

from torch import Tensor, nn

from appliance.studio.autoencoder.networks import Network, Shape, start_layer_at


class DenseDecoder(nn.Sequential):
    """Dense layers that begin with the rest pose."""

    def start_at(self, rest: Tensor) -> None:
        last = self[-1]
        assert isinstance(last, nn.Linear)
        start_layer_at(last, rest.repeat(last.out_features // len(rest)))


class Dense(Network):
    """The pose autoencoder of 'Beyond Imitation': 2 x 64 LeakyReLU each way."""

    encoder: nn.Sequential
    decoder: DenseDecoder

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        inward, outward = (
            [nn.Linear(size, shape.width), nn.LeakyReLU()]
            + [
                layer
                for _ in range(shape.depth - 1)
                for layer in (nn.Linear(shape.width, shape.width), nn.LeakyReLU())
            ]
            for size in (shape.flat, shape.latent)
        )
        self.encoder = nn.Sequential(*inward, nn.Linear(shape.width, shape.coded))
        self.decoder = DenseDecoder(*outward, nn.Linear(shape.width, shape.flat))
