"""An error that the artist can fix is one message and exit status 2, for every command of the studio."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from appliance.pose.file_trouble import sentence
from appliance.studio.heartbeat import heartbeat

REFUSED, INTERRUPTED = 2, 130  # exit statuses


@contextmanager
def clear_errors(command: str) -> Iterator[None]:
    """Turn an error that the artist can fix into one message and exit status 2; never long silent."""
    try:
        with heartbeat():
            yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in ("torch", "onnx", "matplotlib"):
            raise
        _refuse(
            f"bunraku {command} needs {error.name}, which is not installed here. The box dances without it. "
            "Install the studio with: pip install bunraku-studio (in a checkout: make studio)"
        )
    except (ValueError, RuntimeError, OSError) as error:
        message = (
            sentence(error) if isinstance(error, OSError) else str(error) if _is_for_people(error) else None
        )
        if message is None:
            raise
        _refuse(message)


def _is_for_people(error: Exception) -> bool:
    from appliance.dancer.grounding import GroundingError
    from appliance.pictures.filmstrip import MissingPicturesError
    from appliance.pose.bvh import BvhError
    from appliance.show.config_error import ConfigError
    from appliance.studio.data.dataset import DatasetError
    from appliance.studio.studio_error import StudioError

    known = BvhError | ConfigError | DatasetError | GroundingError | MissingPicturesError | StudioError
    return isinstance(error, known)


def _refuse(message: str) -> None:
    if os.environ.get("RANK", "0") == "0":  # only one of the processes that torchrun started speaks
        print(f"bunraku: {message}", file=sys.stderr)
    raise typer.Exit(REFUSED)
