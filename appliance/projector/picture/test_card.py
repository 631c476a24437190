"""The test card: focus, overscan, grey steps, colours, circles, and where the page of this box is."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import segno
from numpy.typing import NDArray
from PIL import Image as Files
from PIL import ImageDraw, ImageFont

from appliance.projector.picture.lettering import lettered

Image = NDArray[np.uint8]

GREYS = 11  # steps from black to white
NEAR = (0, 2, 4, 6, 8, 12, 16)  # levels of 255: steps next to black, and as far from white
OVERSCAN = (0.025, 0.05)  # shares of the picture that a display may cut off at each edge
_COLOURS = ("#ffffff", "#ffff00", "#00ffff", "#00ff00", "#ff00ff", "#ff0000", "#0000ff")
_FOCUS = (1, 2, 3)  # pixels: widths of lines
_STAR = 36  # spokes
_OVERLAP, _EVEN = (255, 128, 0), (48, 112, 192)
_NAMES = (150,) * 3  # the numbers of steps: legible, and not so bright that they hide black
LARGE, SMALL = 2.6, 1.35  # height of type in units: the box's name and PIN; the other words
LEADING, MOST_WORDS = 1.4, 13.0  # from one line to the next in heights of type; the room for all in units
_FAINT = 44  # level of the squares' lines, of 255


def test_card(
    size: tuple[int, int], lines: Sequence[str], address: str = "", shared: tuple[str, float] | None = None
) -> Image:
    """(height, width, 3), top row first. lines: words in its middle, the first one, which is the
    box's name, and the PIN larger; address: as a QR code, '': none.

    shared: which part of the picture this projector lights, and the overlap as a fraction of it: the overlap
    is marked, and the words are where only this projector lights.
    """
    width, height = size
    image = Files.new("RGB", size, (0, 0, 0))
    draw = ImageDraw.Draw(image)
    unit = min(height / 36.0, width / 64.0)  # in an upright picture what is in the middle is smaller
    _grid(draw, width, height)
    _overscan(draw, width, height)
    _circles(draw, width, height, unit)
    _bars(draw, width, height, unit)
    for x in (width / 2 - 23.7 * unit, width / 2 + 23.7 * unit):
        _star(draw, x, height / 2 - 3.6 * unit, 4.2 * unit)
        _focus(draw, x, height / 2 + 2.3 * unit, unit)
    area = (0.0, 0.0, float(width), float(height))
    if shared is not None:
        area = _overlap(draw, width, height, unit, *shared)
        lines = [*lines, f"{shared[0]}, overlap {100 * shared[1]:.1f} %"]
    large = [number for number, line in enumerate(lines) if number == 0 or line.startswith("pin ")]
    _lettering(image, lines, large, address, unit, area)
    return np.asarray(image)


def _grid(draw: ImageDraw.ImageDraw, width: int, height: int) -> None:
    """Squares, a ninth of the height each, from the middle outwards."""
    step = height / 9.0
    faint = (_FAINT,) * 3
    for number in range(-int(width / 2 / step), int(width / 2 / step) + 1):
        x = round(width / 2 + number * step)
        draw.line([(x, 0), (x, height)], faint)
    for number in range(10):
        y = min(height - 1, round(number * step))
        draw.line([(0, y), (width, y)], faint)


def _overscan(draw: ImageDraw.ImageDraw, width: int, height: int) -> None:
    """The outermost pixels in white, what an overscanning display cuts off, and arrows into the corners."""
    draw.rectangle([0, 0, width - 1, height - 1], outline=(255, 255, 255))
    for share, level in zip(OVERSCAN, (200, 120), strict=True):
        x, y = round(share * width), round(share * height)
        draw.rectangle([x, y, width - 1 - x, height - 1 - y], outline=(level, level, level))
    arm = round(0.02 * height)
    for x, y in ((0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)):
        across, down = (arm if x == 0 else -arm), (arm if y == 0 else -arm)
        draw.polygon([(x, y), (x + across, y), (x, y + down)], fill=(255, 255, 255))


def _circles(draw: ImageDraw.ImageDraw, width: int, height: int, unit: float) -> None:
    """One in the middle, one in each corner: round where the picture is not stretched."""
    line = max(1, round(unit / 15))
    places = [(width / 2, height / 2, 16 * unit)]
    corner = 3.6 * unit
    away = 2.2 * unit + corner
    places += [(x, y, corner) for x in (away, width - away) for y in (away, height - away)]
    for x, y, radius in places:
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], outline=(255, 255, 255), width=line)


def _bars(draw: ImageDraw.ImageDraw, width: int, height: int, unit: float) -> None:
    """Colours; grey steps; steps that only just differ from black and from white."""
    left, right = width / 2 - 13.44 * unit, width / 2 + 13.44 * unit

    def row(above: float, tall: float, colours: Sequence[tuple[int, ...] | str], names: int = 0) -> None:
        step, top = (right - left) / len(colours), height / 2 + above
        for number, colour in enumerate(colours):
            x = left + number * step
            draw.rectangle([round(x), round(top), round(x + step) - 1, round(top + tall) - 1], fill=colour)
            if names:
                beyond = top + (-0.3 * unit if names < 0 else tall + 0.3 * unit)
                font = ImageFont.load_default(max(1, round(1.1 * unit)))
                place, at = (x + step / 2, beyond), "mb" if names < 0 else "mt"
                draw.text(place, str(colour[0]), _NAMES, font, anchor=at)

    row(-12.8 * unit, 2.6 * unit, _COLOURS)
    row(-10.2 * unit, 2.2 * unit, [(round(255 * step / (GREYS - 1)),) * 3 for step in range(GREYS)])
    row(8.4 * unit, 1.8 * unit, [(level,) * 3 for level in NEAR], names=-1)
    row(10.2 * unit, 1.8 * unit, [(255 - level,) * 3 for level in reversed(NEAR)], names=1)


def _star(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float) -> None:
    """Spokes that melt in the middle where the lens is not in focus (Siemens)."""
    for spoke in range(_STAR):
        start = 360.0 * spoke / _STAR
        box = [x - radius, y - radius, x + radius, y + radius]
        draw.pieslice(box, start, start + 180.0 / _STAR, fill=(255, 255, 255))


def _focus(draw: ImageDraw.ImageDraw, x: float, y: float, unit: float) -> None:
    """Upright and level lines of one, two and three pixels."""
    side = round(2.4 * unit)
    for number, thick in enumerate(_FOCUS):
        for row in range(2):
            left, top = round(x + (number - 1.5) * 1.15 * side), round(y + row * 1.15 * side)
            for offset in range(0, side, 2 * thick):
                ends = offset + thick - 1
                box = (
                    [left + offset, top, left + ends, top + side]
                    if row == 0
                    else [left, top + offset, left + side, top + ends]
                )
                draw.rectangle(box, fill=(255, 255, 255))


def _overlap(
    draw: ImageDraw.ImageDraw, width: int, height: int, unit: float, part: str, overlap: float
) -> tuple[float, float, float, float]:
    """Two lines around what both projectors light, and even greys across it; returns the room for words: its
    left, top, width and height.
    """
    is_across = part in ("left", "right")
    whole = width if is_across else height
    half = 0.5 * whole * overlap / (2.0 - overlap)
    reach = min(max(13.44 * unit, 1.5 * half), whole / 2)
    for number, level in enumerate(_EVEN):
        along = whole / 2 - reach, whole / 2 + reach
        beside = [
            (height if is_across else width) / 2 + 4.0 * unit * (number + step - 1.5) for step in (0, 1)
        ]
        (x0, x1), (y0, y1) = (along, beside) if is_across else (beside, along)
        draw.rectangle([round(x0), round(y0), round(x1) - 1, round(y1) - 1], fill=(level,) * 3)
    for at in (round(whole / 2 - half), round(whole / 2 + half)):
        ends = [(at, 0), (at, height)] if is_across else [(0, at), (width, at)]
        draw.line(ends, _OVERLAP, max(1, round(unit / 15)))
    room = whole / 2 - max(half, (28.5 if is_across else 17.0) * unit)
    start = 0.0 if part in ("left", "top") else whole - room
    return (start, 0.0, room, float(height)) if is_across else (0.0, start, float(width), room)


def _words(line: str, tall: float, unit: float, limit: int) -> Files.Image:
    """One line of words, `tall` units high, less where it would be wider than `limit` pixels."""
    text = Files.fromarray(lettered(line, max(1, round(tall * unit)), (255, 255, 255)))
    return text if text.width <= limit else text.resize((limit, max(1, text.height * limit // text.width)))


def _lettering(
    image: Files.Image,
    lines: Sequence[str],
    large: Collection[int],
    address: str,
    unit: float,
    area: tuple[float, float, float, float],
) -> None:
    """The words, and the address as a QR code beside them, in the middle of an area."""
    area_left, top, width, height = area
    unit = min(unit, width / 32.0)
    parts: list[Files.Image] = []
    if address:
        code = np.array([list(row) for row in segno.make(address, error="m", micro=False).matrix], bool)
        white = Files.fromarray(np.where(np.pad(code, 4), 0, 255).astype(np.uint8)).convert("RGB")
        times = max(1, round(10.0 * unit / white.width))
        parts.append(white.resize((times * white.width, times * white.height), Files.Resampling.NEAREST))
    if lines:
        limit = max(1, round(29.4 * unit - sum(part.width for part in parts) - unit))
        sizes = [LARGE if number in large else SMALL for number in range(len(lines))]
        sizes = [one * min(1.0, MOST_WORDS / (LEADING * sum(sizes))) for one in sizes]
        words = [_words(line, tall, unit, limit) for line, tall in zip(lines, sizes, strict=True)]
        downs = np.round(LEADING * unit * np.cumsum([0.0, *sizes])).astype(int).tolist()
        ground = Files.new("RGB", (max(one.width for one in words), downs[-2] + words[-1].height))
        for one, tall, down in zip(words, sizes, downs, strict=False):
            middle = round(0.5 * (1.75 * tall * unit - one.height))  # a line that was too wide is lower
            ground.paste(one, ((ground.width - one.width) // 2, down + middle), one)
        parts.append(ground)
    gap = round(unit) if len(parts) > 1 else 0
    left = round(area_left + (width - sum(part.width for part in parts) - gap) / 2)
    for part in parts:
        image.paste(part, (left, round(top + (height - part.height) / 2)))
        left += part.width + gap
