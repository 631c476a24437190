"""`bunraku release`: the releases of this box: list them, install one from a stick, go back."""

from __future__ import annotations

import os
from pathlib import Path

import typer

from appliance.show.config_error import ConfigError, Problem

PROGRAM = Path("/usr/sbin/bunraku-release")


def release(context: typer.Context) -> None:
    """List the releases of this box, install one from a stick, or go back to the one before.

    Raises ConfigError on a machine without the Debian package: there is one version, and pip changes it.
    """
    if not PROGRAM.exists():
        message = "Bunraku was not installed here as a Debian package: there is no release to go back to."
        cure = "For a box: sudo apt install ./bunraku_VERSION_ARCH.deb"
        raise ConfigError([Problem(PROGRAM, 0, message, cure)])
    os.execv(PROGRAM, [str(PROGRAM), *context.args])
