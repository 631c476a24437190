"""The use of each model of `bunraku train --model`: a command of bunraku."""

from __future__ import annotations

from pathlib import Path

from appliance.studio.studio_error import StudioError

IMPROVISER = "improviser"  # the model of a checkpoint that is no autoencoder
USES = {
    "puppet": "bunraku play",
    "pose": "bunraku path, bunraku map",
    "sequence": "bunraku vary",
    IMPROVISER: "bunraku improvise --model",
}
REMOVED = ("conv", "lstm-autoregressive", "lstm256")  # networks of version 0.1.0


def require_supported(architecture: str, path: Path) -> None:
    """Raises StudioError for a file whose architecture was removed after version 0.1.0."""
    if architecture in REMOVED:
        raise StudioError(
            f"{path} is a network of the kind '{architecture}'. Only Bunraku 0.1.0 can read it. Shows that "
            "were exported from it still play. Train a new network with --network mlp or lstm."
        )
