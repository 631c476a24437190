"""Files that are whole or as they were: written under a hidden name beside their own, then renamed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """The file to write in place of `path`, beside it and with its ending; at the end it is renamed.

    After any error, and after Ctrl-C, `path` is as it was. Raises OSError.
    """
    beside = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield beside
        with beside.open("rb+") as written:
            os.fsync(written.fileno())  # else a power cut may leave the new name without the content
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_text_whole(path: Path, text: str) -> None:
    """The same for a text, in UTF-8."""
    with written_whole(path) as beside:
        beside.write_text(text, encoding="utf-8")
