"""The box installed on this machine, for commands that are given no file: what it chose at power-on."""

from __future__ import annotations

import os
import pwd
from pathlib import Path

from appliance.release import choice
from appliance.release.choice import Choice, ShowAndBox, box_of


def box_here(box: Path | None, chosen: Path | None = None) -> Path | None:
    """The box file that is meant; with neither, the one chosen at power-on, on a machine that has such.

    Raises ConfigError where both are given, and where the installed box is closed to this user.
    """
    if box is None and chosen is None and _is_installed():
        chosen = choice.RUN / choice.CHOSEN
    return box_of(box, chosen)


def show_and_box_here(show: Path | None, box: Path | None) -> tuple[Path | None, Path | None]:
    """The same for show and box file; root goes on as the box's own user, for its processes meet in private.

    Raises ConfigError where the installed box is closed to this user.
    """
    if show is not None or box is not None or not _is_installed():
        return show, box
    pair = (Choice.read(choice.RUN / choice.CHOSEN) or Choice((ShowAndBox(),))).first
    _become_owner_of(choice.RUN)
    return pair.show, pair.box


def _is_installed() -> bool:
    try:
        (choice.RUN / choice.CHOSEN).stat()
    except PermissionError:
        from appliance.show.config_error import ConfigError, Problem

        message = "The choice of this box is closed to this user."
        cure = "Put sudo before the command, or name another box file: --box."
        raise ConfigError([Problem(choice.RUN, 0, message, cure)]) from None
    except OSError:
        return False
    return True


def _become_owner_of(folder: Path) -> None:
    """Root becomes the folder's owner; other users stay as they are."""
    owner = folder.stat()
    if os.geteuid() == 0 and owner.st_uid != 0:
        os.initgroups(pwd.getpwuid(owner.st_uid).pw_name, owner.st_gid)
        os.setgid(owner.st_gid)
        os.setuid(owner.st_uid)
