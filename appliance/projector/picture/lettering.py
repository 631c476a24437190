"""Lettering: words in any script as an image, from a font of the show and those of this machine."""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Files
from PIL import ImageDraw, ImageFont, features

MOST_WIDE, MOST_HIGH = 3840, 2160  # pixels: graphics chips have limits
_FOLDERS = ("~/.fonts", "~/.local/share/fonts", "/usr/local/share/fonts", "/usr/share/fonts")
_FIRST = ("DejaVuSans", "NotoSans-Regular", "NotoSansCJK-Regular", "LiberationSans-Regular")
_NO_LETTER = "\U0010fffe"  # no font has it: what stands for it stands for all that a font lacks
_LINE = 1.25  # from one line to the next, in sizes
_SUFFIXES = (".ttf", ".otf", ".ttc")

Font = ImageFont.FreeTypeFont


def lettered(
    text: str, size_px: int, colour: tuple[int, int, int], font: Path | None = None
) -> NDArray[np.uint8]:
    """(height, width, 4) red, green, blue, alpha: lines one below the other, centred.

    size_px: height of a line of type, less where an image would be wider than MOST_WIDE or higher than
    MOST_HIGH; font: tried first.
    Scripts from right to left and those that join letters need the library libraqm, which Pillow's wheels
    bring along. A file that is no font counts as one without letters.
    """
    lines = [_Line(line, size_px, font) for line in text.splitlines()]
    width = max((line.width for line in lines), default=0) + size_px
    height = round(size_px * (_LINE * max(len(lines), 1) + 0.5))
    if (width > MOST_WIDE or height > MOST_HIGH) and size_px > 1:
        fits = min(size_px * MOST_WIDE // width, size_px * MOST_HIGH // height, size_px - 1)
        return lettered(text, max(1, fits), colour, font)
    image = Files.new("RGBA", (width, height), (*colour, 0))
    draw = ImageDraw.Draw(image)
    for row, line in enumerate(lines):
        line.write(draw, (width - line.width) / 2, size_px * (_LINE * row + 1.1), (*colour, 255))
    return np.asarray(image)


def is_font(path: Path) -> bool:
    """Whether a file is a font that can be drawn with."""
    try:
        return bool(ImageFont.truetype(path, 24))
    except OSError:
        return False


def letters_without_font(text: str, font: Path | None = None) -> str:
    """The letters, each once, that neither this font nor any of the machine's has."""
    fonts = _first_then_machines(font)
    return "".join(dict.fromkeys(one for one in text if not any(_has(path, one) for path in fonts)))


def forget_fonts() -> None:
    """Look at font files anew: a show's may have been saved again since, and others installed."""
    for known in (fonts_of_machine, _opened, _has):
        known.cache_clear()


class _Line:
    """A line of words, each run of letters in the first font that has them."""

    def __init__(self, text: str, size_px: int, font: Path | None) -> None:
        chosen = list(zip(text, _fonts_for(text, _first_then_machines(font)), strict=True))
        self._right_to_left = any(unicodedata.bidirectional(letter) in ("R", "AL") for letter in text)
        runs = [
            (path, "".join(letter for letter, _ in run)) for path, run in groupby(chosen, lambda one: one[1])
        ]
        self._runs = [
            (_opened(path, size_px), run) for path, run in (runs[::-1] if self._right_to_left else runs)
        ]
        self.width = round(sum(font.getlength(run) for font, run in self._runs))

    def write(self, draw: ImageDraw.ImageDraw, x: float, baseline: float, colour: tuple[int, ...]) -> None:
        for font, text in self._runs:
            draw.text((x, baseline), text, colour, font, anchor="ls")
            x += font.getlength(text)


def _first_then_machines(font: Path | None) -> list[Path]:
    return [*([] if font is None else [font]), *fonts_of_machine()]


def _fonts_for(text: str, fonts: Sequence[Path]) -> Iterator[Path | None]:
    """The font of each letter: that of the one before where it has it too, so that words stay whole."""
    before: Path | None = None
    for letter in text:
        if before is None or not _has(before, letter):
            before = next((font for font in fonts if _has(font, letter)), fonts[0] if fonts else None)
        yield before


@cache
def fonts_of_machine() -> tuple[Path, ...]:
    """Font files of this machine, the most usual ones first."""
    found = [
        Path(folder, name)
        for root in _FOLDERS
        for folder, _, names in os.walk(Path(root).expanduser())
        for name in names
        if name.lower().endswith(_SUFFIXES)
    ]
    rank = {name: place for place, name in enumerate(_FIRST)}
    return tuple(
        sorted(found, key=lambda path: (rank.get(path.stem, len(rank)), "Regular" not in path.stem, path))
    )


@cache
def _opened(path: Path | None, size_px: int) -> Font:
    if path is None:
        usual = ImageFont.load_default(size_px)
        assert isinstance(usual, ImageFont.FreeTypeFont)
        return usual
    engine = ImageFont.Layout.RAQM if features.check("raqm") else ImageFont.Layout.BASIC
    return ImageFont.truetype(path, size_px, layout_engine=engine)


@cache
def _has(path: Path, letter: str) -> bool:
    """Whether a font draws the letter, and not the box that stands for those that it lacks."""
    if letter.isspace() or unicodedata.category(letter) in ("Cf", "Cc"):
        return True
    try:
        font = ImageFont.truetype(path, 24, layout_engine=ImageFont.Layout.BASIC)
        return bytes(font.getmask(letter)) != bytes(font.getmask(_NO_LETTER))
    except OSError:
        return False
