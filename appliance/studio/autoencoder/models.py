"""Models for `bunraku train`: each in a compact form, the default, and as the papers published it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from appliance.studio.autoencoder.architectures import DEFAULT
from appliance.studio.autoencoder.losses import LossWeights
from appliance.studio.autoencoder.training import Settings
from appliance.studio.data.dataset import WINDOW
from appliance.studio.improviser.improviser_training import ImproviserSettings
from appliance.studio.improviser.pose_mixtures_training import PoseMixturesSettings
from appliance.studio.model_uses import IMPROVISER
from appliance.studio.studio_error import StudioError

SQUARED_ALONE = LossWeights(
    rotation=0.0, pace=0.0, unit_norm=0.0, position=0.0, prior=0.0, squared=1.0, divergence=1e-4
)


@dataclass(frozen=True)
class Model:
    """A kind of network: its window in poses, and settings by network, the default first.

    shortest, longest: windows that may be asked for.
    """

    window: int
    networks: dict[str, dict[str, Any]]
    shortest: int = 4
    longest: int = 128


PUPPETS: tuple[str, ...] = (DEFAULT, "mlp", "lstm")
MODELS = {
    "puppet": Model(WINDOW, {name: {} for name in PUPPETS}),
    "pose": Model(
        1,
        {
            "mlp": {
                "weights": LossWeights(prior=0.0),
                "variational": True,
                "latent": 32,
                "width": 256,
                "depth": 2,
                "minutes": 15.0,
            },
            # Section 'Pose autoencoder' of 'Beyond Imitation'
            "dense64": {
                "weights": SQUARED_ALONE,
                "latent_noise": 0.0,
                "learning_rate": 1e-4,
                "batch": 128,
                "minutes": 15.0,
            },
        },
        shortest=1,
        longest=1,
    ),
    "sequence": Model(
        128,
        {
            "mlp": {
                "weights": LossWeights(prior=0.0, divergence=1e-4, speed=8.0),
                "variational": True,
                "batch": 64,
                "latent": 128,
                "width": 512,
                "depth": 3,
                "minutes": 45.0,
            },
            # Section 'Sequence VAE' of 'Beyond Imitation'
            "lstm384": {"weights": SQUARED_ALONE, "variational": True, "minutes": 45.0, "batch": 128},
        },
        shortest=16,
    ),
    # Section 'LSTM' of 'Beyond Imitation' is lstm-mixtures; its look-back is the window
    IMPROVISER: Model(32, {"moves": {}, "lstm-mixtures": {}}, shortest=10),
}
AnySettings = Settings | ImproviserSettings | PoseMixturesSettings
IMPROVISERS: dict[str, type[ImproviserSettings] | type[PoseMixturesSettings]] = {
    "moves": ImproviserSettings,
    "lstm-mixtures": PoseMixturesSettings,
}


def settings_from(saved: Mapping[str, Any]) -> AnySettings:
    """The settings of any model's checkpoint."""
    if saved.get("model") == IMPROVISER:
        return IMPROVISERS[saved["network"]](**saved)
    return Settings.from_state(saved)


def settings_for(model: str, network: str | None = None, seed: int = 1, **sizes: float) -> AnySettings:
    """Settings of a model and network; sizes that are not 0 override its own. Raises StudioError."""
    kind = MODELS[model]
    network = network or next(iter(kind.networks))
    if network not in kind.networks:
        raise StudioError(
            f"--model {model} has the networks {', '.join(kind.networks)}, not {network}. Choose one of them."
        )
    window = sizes.get("window") or kind.window
    if not kind.shortest <= window <= kind.longest:
        fits = f"{kind.shortest} to {kind.longest} poses" if kind.longest > 1 else "one pose: omit it"
        raise StudioError(f"--window {window} is not for --model {model}, which takes {fits}.")
    make = IMPROVISERS.get(network, Settings)
    asked, known = {k: v for k, v in sizes.items() if v}, {field.name for field in fields(make)}
    for name in asked.keys() - known:
        raise StudioError(f"--{name.replace('_', '-')} is not for the network {network}. Omit it.")
    own = {"window": window} if "window" in known else {}
    return make(model=model, network=network, seed=seed, **{**own, **kind.networks[network], **asked})
