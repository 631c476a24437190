"""Files from others: only regular ones are opened, and no more is read than their reader accepts."""

from __future__ import annotations

import codecs
import errno
import json
import os
import re
import stat
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import Any

_LARGEST_STORED = 1 << 22
_SAMPLE = 1 << 18  # bytes at the start of a text that tell its encoding; they hold a skeleton's names
_JAPANESE = re.compile("[\u3040-\u30ff\u4e00-\u9fff]{2,}")  # kana or kanji side by side


class TooLargeError(OSError):
    """A file that is larger than its reader takes."""


def opened(path: Path) -> BufferedReader:
    """A regular file, to be read. Raises OSError for anything else: a FIFO or a device may never end."""
    kind = path.stat().st_mode
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(kind):
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    return os.fdopen(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK), "rb")


def encoding_of(sample: bytes) -> str:
    """The encoding of a text by its beginning: UTF-16 by its mark, UTF-8, Shift-JIS, else Latin.

    A few damaged bytes do not change it. Shift-JIS needs Japanese words: an umlaut of a Latin encoding and
    the letter behind it may make one kanji, hardly two.
    """
    if sample[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    if sample.isascii():
        return "utf-8-sig"
    text = sample.rstrip(bytes(range(128, 256))).decode("utf-8", "replace")
    damaged, letters = text.count("\ufffd"), sum(letter > "\x7f" for letter in text)
    if damaged <= letters // 2:
        return "utf-8-sig"
    text = sample.decode("cp932", "replace")
    japanese = sum(map(len, _JAPANESE.findall(text)))
    return "cp932" if japanese > text.count("\ufffd") else "cp1252"


def opened_text(path: Path) -> TextIOWrapper:
    """A regular file as text in its own encoding; what is no letter in it is replaced. Raises OSError."""
    stream = opened(path)
    encoding = encoding_of(stream.read(_SAMPLE))
    stream.seek(0)
    return TextIOWrapper(stream, encoding=encoding, errors="replace")


def content(path: Path, largest: int) -> bytes:
    """All of a regular file. Raises TooLargeError above `largest` bytes, OSError for what is no such file."""
    with opened(path) as stream:
        data = stream.read(largest + 1) if os.fstat(stream.fileno()).st_size <= largest else None
    if data is None or len(data) > largest:
        size = f"{largest / 1e6:g} MB" if largest >= 1e6 else f"{largest / 1024:g} kB"
        raise TooLargeError(errno.EFBIG, f"it is larger than {size}", str(path))
    return data


def require_inside(path: Path, folder: Path) -> None:
    """Raises OSError where a link leads out of the folder, or nowhere."""
    real = Path(os.path.realpath(path, strict=True))
    if not real.is_relative_to(os.path.realpath(folder)):
        raise OSError(errno.EXDEV, "a link leads out of the folder: put the file itself there", str(path))


def stored_json(path: Path) -> Any:
    """The values in a small file that this box wrote. Raises OSError, or ValueError for a spoilt one."""
    return plain_json(content(path, _LARGEST_STORED))


def plain_json(text: str | bytes) -> Any:
    """The values in a text. Raises ValueError for what is no JSON, also where it is nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def with_tuples(value: Any) -> Any:
    """Values from JSON with tuples for its lists, as frozen settings have them."""
    if isinstance(value, dict):
        return {name: with_tuples(one) for name, one in value.items()}
    return tuple(map(with_tuples, value)) if isinstance(value, list) else value
