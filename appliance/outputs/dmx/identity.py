"""The component identifier (CID) by which sACN receivers recognise a box: made once, then kept."""

from __future__ import annotations

import contextlib
from pathlib import Path
from uuid import UUID, uuid4

from appliance.box.durable import write_whole
from appliance.pose.foreign_file import content

FILE = "sacn-cid"
_LARGEST = 100


def component_identifier(state: Path | None) -> UUID:
    """The one in the state folder, made where there is none (E1.31 section 5.6).

    Without a folder, or where it cannot be written, a new one each time: receivers then see a new source.
    """
    fresh = uuid4()
    if state is None:
        return fresh
    saved = _read(state / FILE)
    if saved is not None:
        return saved
    with contextlib.suppress(OSError):
        state.mkdir(parents=True, exist_ok=True)
        write_whole(state / FILE, f"{fresh}\n".encode())
    return fresh


def _read(file: Path) -> UUID | None:
    try:
        return UUID(content(file, _LARGEST).decode("ascii").strip())
    except (OSError, ValueError):
        return None
