"""The adversarial autoencoder of 'Puppeteering an AI': heading removal around any network, and the iteration.

Each window is turned so that its middle pose faces +Z, and turned back at the end: a dancer's habits do not
depend on where the audience sits, so no network has to learn them for each heading.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.coupled import Coupled, share_of_pass
from appliance.studio.autoencoder.held_joints import HeldJoints, HeldPlaces
from appliance.studio.autoencoder.networks import Network, Shape

NEAR = 1.0 - 1e-6  # length of a goal: keeps its cosine with a pose below 1, so that no weight vanishes


class Autoencoder(nn.Module):
    """Windows (B, T, M, 4) in, windows out; `iterate` is the paper's iterative autoencoding."""

    def __init__(self, network: Network, shape: Shape, rest: Tensor) -> None:
        """rest (M, 4): mean heading-free orientation of each joint; all signs follow its hemisphere."""
        super().__init__()
        self.network, self.shape = network, shape
        self.rest: Tensor
        self.register_buffer("rest", rest.float())

    def facing(self, windows: Tensor) -> Tensor:
        """Heading (B, 4) of the root joint in the middle of each window."""
        return rotation.heading(windows[:, windows.shape[1] // 2, 0])

    def without_heading(self, windows: Tensor, facing: Tensor) -> Tensor:
        """Windows turned to face +Z, every quaternion in the rest pose's hemisphere."""
        root = rotation.multiply(rotation.inverse(facing)[:, None], windows[:, :, 0])
        return self._aligned(torch.cat([root[:, :, None], windows[:, :, 1:]], dim=2))

    def with_heading(self, windows: Tensor, facing: Tensor) -> Tensor:
        root = rotation.multiply(facing[:, None].expand(-1, windows.shape[1], -1), windows[:, :, 0])
        return torch.cat([root[:, :, None], windows[:, :, 1:]], dim=2)

    def encode(self, windows: Tensor) -> Tensor:
        """Heading-free windows -> latents (B, Z); of a variational network their means."""
        return self.network.encode(windows.flatten(1))[:, : self.shape.latent]

    def encode_gaussian(self, windows: Tensor) -> tuple[Tensor, Tensor]:
        """Heading-free windows -> means and log variances (B, Z) of a variational network."""
        mean, log_variance = self.network.encode(windows.flatten(1)).chunk(2, dim=-1)
        return mean, log_variance.clamp(-12.0, 4.0)

    def decode_raw(self, latents: Tensor) -> Tensor:
        """Latents -> heading-free windows before normalisation."""
        return self.network.decode(latents).view(-1, self.shape.window, self.shape.joints, 4)

    def decode(self, latents: Tensor) -> Tensor:
        return rotation.normalize(self.decode_raw(latents))

    def iterate(
        self,
        windows: Tensor,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[Tensor] | None = None,
        liveliness: float = 1.0,
        noise: Tensor | None = None,
        placed: HeldPlaces[Tensor] | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Iterative autoencoding: (B, T, M, 4) -> the same, and the last latents (B, Z).

        The first interaction_iterations passes bring the held joints towards their targets: a coupled network
        moves the latent, for any other SLERP overwrites the window before it is coded. If all passes are
        interactive, the result is overwritten too, so that the held orientation shows; otherwise the last
        pass is the dancer's own. liveliness, 0 to 1, noise (B, Z) or (Z,), and joints that are placed: of a
        coupled network.
        """
        facing = self.facing(windows)
        x = start = self.without_heading(windows, facing)
        latents = x.new_zeros(len(x), self.shape.latent)
        held, goal = x.new_zeros(len(x), self.shape.joints), x
        if hold is not None:
            held = (hold.mask.float() * hold.weights).expand(len(x), -1)
            goal = self.without_heading(hold.targets.expand_as(x), facing)
        led = min(interaction_iterations, coding_iterations)
        coupled = self.network if isinstance(self.network, Coupled) else None
        if coupled is not None and led:
            whole = 1 - (1 - held) ** max(1, interaction_iterations)  # what the weights of all passes come to
            meant = slerp_towards(start, goal, whole[:, None, :, None])
            lively = x.new_full((len(x),), liveliness)
            drawn = latents if noise is None else noise.expand_as(latents)
            plain, pasted = self.encode(torch.cat([start, meant])).chunk(2)
            pull = coupled.pull((plain, pasted), start, meant, (held > 0).float(), lively, drawn)
        if placed is not None:
            places = placed.places.expand(len(x), -1, -1)
            place_weights = placed.weights.expand(len(x), -1)
        for k in range(coding_iterations):
            if k < led and coupled is None:
                x = slerp_towards(x, goal, held[:, None, :, None])
            latents = self.encode(x)
            if k < led and coupled is not None:
                latents = latents + share_of_pass(k) * pull
                if placed is not None:
                    latents = latents + coupled.step_to_places(x, places, place_weights)
            x = self.decode(latents)
        if interaction_iterations >= coding_iterations:
            x = slerp_towards(x, goal, held[:, None, :, None])
        return self.with_heading(x, facing), latents

    def _aligned(self, windows: Tensor) -> Tensor:
        dots = (windows * self.rest).sum(-1, keepdim=True)
        return torch.where(dots < 0, -windows, windows)


def slerp_towards(x: Tensor, goal: Tensor, weight: Tensor) -> Tensor:
    """SLERP the short way from x to goal by weight; weight 0 gives x, 1 gives +-goal."""
    goal = NEAR * goal
    dot = (x * goal).sum(-1, keepdim=True)
    angle = torch.acos(dot.abs())
    towards = torch.where(dot < 0, -goal, goal)
    mixed = torch.sin(angle * (1 - weight)) * x + torch.sin(angle * weight) * towards
    return rotation.normalize(mixed)


class PriorCritic(nn.Module):
    """Discriminates latents from samples of the prior, a standard Gaussian; dense 512, 512, ELU (paper)."""

    def __init__(self, latent: int, width: int = 512) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(latent, width), nn.ELU(), nn.Linear(width, width), nn.ELU(), nn.Linear(width, 1)
        )

    def forward(self, latents: Tensor) -> Tensor:
        """Logits (B,): high for what looks like the prior."""
        logits: Tensor = self.layers(latents)
        return logits[:, 0]
