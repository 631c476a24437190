"""Room on the disk, asked for before hours of work and not after them."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path

NEEDED_BYTES = 100 << 20  # a checkpoint of the largest network, while the one before is still there
_UNKNOWN = (errno.EOPNOTSUPP, errno.EINVAL)  # this kind of disk cannot say


def require_room(folder: Path) -> None:
    """Make the folder, and prove that files can be written there. Raises OSError with the path."""
    folder.mkdir(parents=True, exist_ok=True)
    trial = folder / ".room"
    try:
        with trial.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, NEEDED_BYTES)
    except OSError as error:
        if error.filename is None and error.errno not in _UNKNOWN:
            raise OSError(error.errno, error.strerror, str(folder)) from None
        if error.filename is not None:
            raise
    finally:
        with contextlib.suppress(OSError):
            trial.unlink(missing_ok=True)
