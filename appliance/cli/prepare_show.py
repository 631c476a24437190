"""Making a show's phrases ready where it is installed or copied to: its first start is as quick as all."""

from __future__ import annotations

import contextlib
from pathlib import Path

from appliance.dancer.phrase_cache import FOLDER, prepare
from appliance.release.choice import EMBEDDED_SHOW
from appliance.show.show import load_show


def prepare_show(directory: Path = EMBEDDED_SHOW) -> None:
    """Keep them in the bundle, for every user of this machine; on a full or read-only disk nothing is done.

    Raises ConfigError, BvhError, GroundingError: this is no sound show.
    """
    show = load_show(directory)
    prepare(show.phrases.values(), directory, show.skeleton, show.config.motion.grounded)
    with contextlib.suppress(OSError):
        (directory / FOLDER).chmod(0o755)


if __name__ == "__main__":
    prepare_show()
