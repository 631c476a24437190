"""The networks: encoders and decoders of a window of poses, one class for each architecture.

Each maps a flat window (B, 8 * M * 4) to a latent (B, Z) and back to raw quaternions of the same shape.
architectures.py has their names on the command line.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn


@dataclass(frozen=True)
class Shape:
    """The dimensions of a network: window poses, moving joints, latent size, width and depth of its layers.

    variational: whether the encoder gives a Gaussian, means and log variances, instead of a point.
    """

    window: int
    joints: int
    latent: int
    width: int
    depth: int = 1
    curves: int = 4  # cosines in time that the mlp sees, of the 8 that the window's poses could have
    variational: bool = False

    @property
    def pose(self) -> int:
        return self.joints * 4

    @property
    def flat(self) -> int:
        return self.window * self.pose

    @property
    def coded(self) -> int:
        """Numbers that the encoder gives."""
        return 2 * self.latent if self.variational else self.latent


class Network(nn.Module):
    """An encoder and a decoder; the latent is linear, so that a Gaussian prior can shape it."""

    encoder: nn.Module
    decoder: nn.Module

    def encode(self, window: Tensor) -> Tensor:
        latent: Tensor = self.encoder(window)
        return latent

    def decode(self, latent: Tensor) -> Tensor:
        window: Tensor = self.decoder(latent)
        return window

    def start_at(self, rest: Tensor) -> None:
        """Make the rest pose (M * 4) the decoder's first output, not noise."""
        self.decoder.start_at(rest)  # type: ignore[operator]


class Residual(nn.Module):
    """x + dense(ELU(layer norm(x))): the step that lets a small dense network learn fast."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm, self.dense = nn.LayerNorm(width), nn.Linear(width, width)
        nn.init.zeros_(self.dense.weight)
        nn.init.zeros_(self.dense.bias)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = x + self.dense(nn.functional.elu(self.norm(x)))
        return out


class TimeBasis(nn.Module):
    """A window as a few smooth curves: the first cosines along time, (B, T * P) <-> (B, C * P).

    Bodies have mass: of a window's 160 ms the slowest four cosines hold all but 0.09 degrees of the recorded
    dances. That halves the first and the last layer, the largest of a small dense network.
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        moment = (torch.arange(shape.window) + 0.5) / shape.window
        curves = torch.cos(torch.pi * torch.arange(shape.curves)[:, None] * moment)
        self.curves: Tensor
        self.register_buffer("curves", curves / curves.norm(dim=1, keepdim=True))

    def project(self, window: Tensor) -> Tensor:
        """(B, T * P) -> (B, C * P)."""
        steps = window.view(-1, self.shape.window, self.shape.pose)
        return torch.matmul(self.curves, steps).flatten(1)

    def unfold(self, amounts: Tensor) -> Tensor:
        """(B, C * P) -> (B, T * P)."""
        steps = amounts.view(-1, self.shape.curves, self.shape.pose)
        return torch.matmul(self.curves.T, steps).flatten(1)


class MlpEncoder(nn.Module):
    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.time = TimeBasis(shape)
        self.stack = _dense_stack(shape.curves * shape.pose, shape.width, shape.depth, shape.coded)

    def forward(self, window: Tensor) -> Tensor:
        latent: Tensor = self.stack(self.time.project(window))
        return latent


class MlpDecoder(nn.Module):
    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.time = TimeBasis(shape)
        self.stack = _dense_stack(shape.latent, shape.width, shape.depth, shape.curves * shape.pose)

    def forward(self, latent: Tensor) -> Tensor:
        return self.time.unfold(self.stack(latent))

    def start_at(self, rest: Tensor) -> None:
        """Make the rest pose (M * 4), held still, the first output."""
        still = self.time.project(rest.repeat(self.time.shape.window)[None])[0]
        start_layer_at(self.stack[-1], still)


def _dense_stack(size_in: int, width: int, depth: int, size_out: int) -> nn.Sequential:
    blocks = [Residual(width) for _ in range(depth)]
    return nn.Sequential(
        nn.Linear(size_in, width), *blocks, nn.LayerNorm(width), nn.ELU(), nn.Linear(width, size_out)
    )


def start_layer_at(layer: nn.Module, rest: Tensor) -> None:
    """Make `rest`, one number for each output of a linear layer, what the layer first gives."""
    assert isinstance(layer, nn.Linear) and layer.bias is not None
    layer.bias.data.copy_(rest)
    layer.weight.data *= 0.1


class Mlp(Network):
    """The window as four curves through residual dense layers: compact."""

    encoder: MlpEncoder
    decoder: MlpDecoder

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.encoder, self.decoder = MlpEncoder(shape), MlpDecoder(shape)

    @torch.no_grad()
    def standardise(self, mean: Tensor, deviation: Tensor) -> None:
        """Map latents of this mean and deviation (Z,) to the prior's 0 and 1; windows stay the same."""
        last, first = self.encoder.stack[-1], self.decoder.stack[0]
        assert isinstance(last, nn.Linear) and isinstance(first, nn.Linear)
        size = len(mean)
        last.weight[:size] /= deviation[:, None]
        last.bias[:size] = (last.bias[:size] - mean) / deviation
        last.bias[size:] -= 2 * deviation.log()[: len(last.bias) - size]  # only in a variational network
        first.bias.add_(first.weight @ mean)
        first.weight *= deviation


class LstmEncoder(nn.Module):
    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.window, self.pose = shape.window, shape.pose
        self.lstm = nn.LSTM(shape.pose, shape.width, num_layers=shape.depth, batch_first=True)
        self.dense, self.last = nn.Linear(shape.width, shape.width), nn.Linear(shape.width, shape.coded)

    def forward(self, window: Tensor) -> Tensor:
        steps, _ = self.lstm(window.view(-1, self.window, self.pose))
        latent: Tensor = self.last(nn.functional.elu(self.dense(steps[:, -1])))
        return latent


class LstmDecoder(nn.Module):
    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.window = shape.window
        self.dense = nn.Linear(shape.latent, shape.width)
        self.lstm = nn.LSTM(shape.width, shape.width, num_layers=shape.depth, batch_first=True)
        self.last = nn.Linear(shape.width, shape.pose)

    def forward(self, latent: Tensor) -> Tensor:
        x = nn.functional.elu(self.dense(latent))
        steps, _ = self.lstm(x[:, None].expand(-1, self.window, -1))
        window: Tensor = self.last(steps)
        return window.flatten(1)

    def start_at(self, rest: Tensor) -> None:
        start_layer_at(self.last, rest)


class Lstm(Network):
    """The papers' network: LSTM each way, 2 x 512 in 'Puppeteering an AI', 3 x 384 in 'Beyond Imitation'.

    Two departures, both needed for what the paper describes: the latent is linear (a ReLU latent cannot
    follow a Gaussian of mean zero), and the dense layers are ELU as in the paper's critic.
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.encoder, self.decoder = LstmEncoder(shape), LstmDecoder(shape)
