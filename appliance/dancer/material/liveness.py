"""Liveness of a network of motion: does it know the dance, and do its latents say anything?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from appliance.dancer.material.latent_paths import Latents
from appliance.dancer.material.map_reach import MapReach
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.pose import quaternion
from appliance.pose.quaternion import Array

SAMPLES = 48  # windows of the dance, and latents of the prior
DEAD = 0.35  # fraction of the usual difference between two windows; less counts as none. Alive: 1.1 to 1.3
UNLEARNED = 0.7  # fraction of it; giving the mean pose is that far off, a trained network 0.05 to 0.34
ACTIVE = 0.1  # standard deviation over the dance from which on a number of the latent says something

Encode = Callable[[Array], Latents]
Decode = Callable[[Latents], Array]


@dataclass(frozen=True)
class Liveness:
    """Mean joint angles in degrees, headings left out: usual, between two windows of the dance; coded, from a
    window to the same encoded and decoded; sampled, between decoded samples of the prior. active: numbers of
    the latent, of `latent`, that say something about the dance.
    """

    usual: float
    coded: float
    sampled: float
    active: int
    latent: int

    @property
    def cause(self) -> str:
        """'' if it is alive, else collapsed, deaf or unlearned: what comes first explains what follows."""
        if self.active == 0:
            return "collapsed"
        if not self.sampled >= DEAD * self.usual:
            return "deaf"
        return "unlearned" if not self.coded <= UNLEARNED * self.usual else ""

    def sentence(self) -> str:
        """Says which part is dead, why, and what to do; '' if it is alive."""
        return {
            "": "",
            "collapsed": (
                f"The network is dead: none of the {self.latent} numbers of its latent says anything about "
                "the dance (its prior has won), so every dance becomes the same. Bring more recordings, or "
                "train with fewer numbers (--latent 8)."
            ),
            "deaf": (
                "The network is dead: its decoder ignores the latents; two of its dances differ by "
                f"{self.sampled:.1f} degrees a joint, two moments of the dancer by {self.usual:.0f}. Noise, "
                "a walk or a line changes nothing. Train anew, with another --seed or the default network."
            ),
            "unlearned": (
                f"The network has not learned the dance: it gives it back {self.coded:.0f} degrees a joint "
                f"off, and two moments of the dancer differ by {self.usual:.0f}. Train longer (--minutes), "
                "or on recordings of this dancer."
            ),
        }[self.cause]


def liveness_of(windows: Array, latent: int, encode: Encode, decode: Decode) -> Liveness:
    """windows (W, T, M, 4) of a dance; encode, decode: windows that face ahead to latents (W, Z) and back."""
    chosen = np.linspace(0, len(windows) - 1, min(SAMPLES, len(windows))).round().astype(int)
    some = np.array(windows[chosen], np.float32)
    facing = quaternion.heading(some[:, some.shape[1] // 2, 0])
    some[:, :, 0] = quaternion.multiply(quaternion.inverse(facing)[:, None], some[:, :, 0])
    codes = encode(some)
    noise = np.random.default_rng(1).standard_normal((SAMPLES, latent)).astype(np.float32)
    made, drawn = (quaternion.normalize(decode(each).astype(np.float64)) for each in (codes, noise))
    return Liveness(
        _apart(some, np.roll(some, len(some) // 2, axis=0)),
        _apart(some, made),
        _apart(drawn, np.roll(drawn, SAMPLES // 2, axis=0)),
        int((codes.std(axis=0) > ACTIVE).sum()),
        latent,
    )


def network_liveness(network: MotionNetwork, poses: Array) -> Liveness:
    """Liveness of a network's file. poses (T, M, 4): a dance of its joints."""
    length = network.window
    starts = np.linspace(0, max(0, len(poses) - length), SAMPLES).round().astype(int)
    windows = quaternion.continuous(poses)[np.minimum(starts[:, None] + np.arange(length), len(poses) - 1)]
    return liveness_of(windows, network.latent, lambda given: network.encode(given)[0], network.decode)


def what_is_dead(network: MotionNetwork, poses: Array) -> str:
    """A warning about the network as a whole, else about its map; '' for a live one.

    poses (T, M, 4): a dance of its joints.
    """
    dead = network_liveness(network, poses).sentence()
    if dead or network.ground is None:
        return dead
    middle, directions, low, high = network.ground

    def poses_at(points: Array) -> Array:
        return network.decode((middle + points @ directions).astype(np.float32))[:, 0]

    reached = MapReach.of(low, high, poses_at, poses)
    return reached.sentence() if reached.is_dead else ""


def _apart(one: Array, other: Array) -> float:
    """Mean angle over the joints but the root, which has the heading; windows (W, T, M, 4)."""
    return float(np.degrees(quaternion.angle_between(one, other))[..., 1:].mean())
