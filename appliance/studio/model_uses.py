"""What the models of `bunraku train --model` are good for, by name: a command of bunraku."""

from __future__ import annotations

IMPROVISER = "improviser"  # the model of a checkpoint that is no autoencoder
USES = {
    "puppet": "bunraku play",
    "pose": "bunraku path, bunraku map",
    "sequence": "bunraku vary",
    IMPROVISER: "bunraku improvise --model",
}
