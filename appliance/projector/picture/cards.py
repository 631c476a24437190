"""Cards: words, images and plain colours over the dance, as bright as the picture is."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np

from appliance.levers.show_state import ShowState
from appliance.levers.table import CARD
from appliance.projector.picture.drawing import Drawing
from appliance.projector.picture.image_file import LINES, MOST_WIDE, Image, read_image, texture_of
from appliance.projector.picture.lettering import forget_fonts, is_font, lettered, letters_without_font
from appliance.projector.picture.wall import Wall
from appliance.show.card import CardConfig

_log = logging.getLogger(__name__)

MARGIN = 0.03  # fraction of the picture's width that stays free on both sides
_GAP = 0.4  # between image and words, in heights of a line
_WHITE = "#ffffff"


@dataclass(frozen=True)
class _Card:
    """A card on the GPU. content: None where it has neither words nor image; height: of the picture's."""

    content: moderngl.Texture | None
    height: float
    place: tuple[float, float]
    ground: tuple[float, float, float, float]

    def box(self, aspect: float) -> tuple[float, float, float, float]:
        """Left, lower, right, upper in shares of the picture, y up; it keeps its shape and stays inside."""
        if self.content is None:
            return 0.0, 0.0, 1.0, 1.0
        width = self.height / aspect * self.content.width / self.content.height
        shrunk = min(1.0, (1 - 2 * MARGIN) / width, 1.0 / self.height)
        half_width, half_height = 0.5 * shrunk * width, 0.5 * shrunk * self.height
        x, y = self.place[0], 1 - self.place[1]
        return x - half_width, y - half_height, x + half_width, y + half_height


class Cards:
    """Draws the cards of a show: one, or two that cross-fade."""

    def __init__(
        self,
        gl: moderngl.Context,
        cards: Mapping[str, CardConfig],
        directory: Path,
    ) -> None:
        self._gl = gl
        forget_fonts()
        self._nothing = gl.texture((1, 1), 4, bytes(4))
        self._drawings = {
            gamma: Drawing(gl, "laid", "card", parts=["GAMMA"] * gamma) for gamma in (False, True)
        }
        self._cards = {}
        for name, config in cards.items():
            content = content_of(config, directory)
            self._cards[name] = _Card(
                None if content is None else texture_of(gl, content),
                0.0 if content is None else content.shape[0] / LINES,
                config.place,
                (*_rgb(config.background), 1.0) if config.background else (0.0, 0.0, 0.0, 0.0),
            )
        self._none = _Card(None, 0.0, (0.5, 0.5), (0.0, 0.0, 0.0, 0.0))

    def draw(self, wall: Wall, show_state: ShowState, now: float) -> None:
        """Lay the cards that are declared over what is on the wall."""
        card = show_state[CARD]
        share = card.share(now)
        shown, before = (self._cards.get(name, self._none) for name in (card.value, card.before))
        if shown is self._none and (before is self._none or share == 1.0):
            return
        wall.framebuffer.use()
        wall.framebuffer.viewport = (0, 0, *wall.display)
        self._gl.enable_only(moderngl.BLEND)
        self._gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        inputs = {
            "content": shown.content or self._nothing,
            "content_before": before.content or self._nothing,
            "place": shown.box(wall.aspect),
            "place_before": before.box(wall.aspect),
            "ground": shown.ground,
            "ground_before": before.ground,
            "share": share,
            "clip_from_picture": wall.clip_from_picture,
            "box": (0.0, 0.0, 1.0, 1.0),
            "opacity": 1.0,
            "level": wall.level,
            "inverse_gamma": 1.0 / wall.gamma,
        }
        self._drawings[wall.gamma != 1.0].draw(inputs, moderngl.TRIANGLE_STRIP, 4)

    def release(self) -> None:
        """Give the GPU's memory back."""
        for card in self._cards.values():
            if card.content is not None:
                card.content.release()
        self._nothing.release()
        for drawing in self._drawings.values():
            drawing.release()


def content_of(card: CardConfig, directory: Path) -> Image | None:
    """(height, width, 4) in pixels of a picture of LINES rows: the image above the words; None: neither."""
    parts: list[Image] = []
    for make in (_image_of, _words_of):
        try:
            parts += make(card, directory)
        except OSError as error:
            _log.warning(
                f"The card '{card.name}' cannot be drawn whole ({error}). The audience sees it without that. "
                "Save its image or font file anew."
            )
    if not parts:
        return None
    return _stacked(parts, round(_GAP * _line_of(card)))


def _line_of(card: CardConfig) -> int:
    """Height of a line of its words, in rows."""
    return max(1, round(card.size * LINES))


def _image_of(card: CardConfig, directory: Path) -> list[Image]:
    """Its image, if it has one. Raises OSError."""
    if card.image is None:
        return []
    return [_sized(read_image(directory / card.image), round(card.image_size * LINES))]


def _words_of(card: CardConfig, directory: Path) -> list[Image]:
    """Its words, if it has any. Raises OSError."""
    if not card.text.strip():
        return []
    font = None if card.font is None else directory / card.font
    if font is not None and not is_font(font):
        _log.warning(
            f"{font} cannot be read as a font. The audience sees the words of the card '{card.name}' "
            "in another one. Save it anew."
        )
    if lacking := letters_without_font(card.text, font):
        _log.warning(
            f"No font of this machine has '{lacking[:20]}' of the card '{card.name}'. The audience "
            "sees boxes there. Name a font file in the bundle under the card's `font`, or install "
            "one (Debian packages fonts-noto-core, fonts-noto-cjk)."
        )
    return [lettered(card.text, _line_of(card), _bytes(card.colour or _WHITE), font)]


def _sized(image: Image, lines: int) -> Image:
    from PIL import Image as Files

    lines = max(1, min(lines, image.shape[0] * MOST_WIDE // image.shape[1]))
    size = max(1, round(image.shape[1] * lines / image.shape[0])), lines
    return np.asarray(Files.fromarray(image).resize(size, Files.Resampling.LANCZOS))


def _stacked(parts: list[Image], gap: int) -> Image:
    """One below the other, centred."""
    width = max(part.shape[1] for part in parts)
    height = sum(part.shape[0] for part in parts) + gap * (len(parts) - 1)
    whole, top = np.zeros((height, width, 4), np.uint8), 0
    for part in parts:
        left = (width - part.shape[1]) // 2
        whole[top : top + part.shape[0], left : left + part.shape[1]] = part
        top += part.shape[0] + gap
    return whole


def _bytes(colour: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = _bytes(colour)
    return red / 255, green / 255, blue / 255
