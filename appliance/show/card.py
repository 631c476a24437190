"""show.yaml's section about cards: what is shown over the dance, like a title, a logo or black."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, field_validator

from appliance.levers.sources import NO_CARD
from appliance.show.picture_file import Colour, PictureFile
from appliance.show.section import BundleFile, Section, key, refusal

BLANK = "blank"
MOST_CARDS = 32


class CardConfig(Section):
    """A card over the dance: text, an image, a background, or some of them."""

    name: str = key("Name for cues and /card.", length=(1, 64))
    text: str = key("Text in any script; a line break starts a new line.", "", length=(0, 1000))
    image: PictureFile | None = key("PNG or JPEG file in the bundle, above the words.", None)
    background: Colour = key("Default: the dance shows through.", None)
    colour: Colour = key("Colour of the text; default: white.", None)
    size: float = key("Height of a line of text, as a fraction of the picture's.", 0.08, within=(0.01, 0.5))
    image_size: float = key("Height of the image, as a fraction of the picture's.", 0.4, within=(0.02, 1))
    place: Annotated[tuple[float, float], Field(strict=False)] = key(
        "Position of its middle, in fractions of the picture's width and height from the top left.",
        (0.5, 0.5),
    )
    font: BundleFile | None = key(
        "Font file (.ttf, .otf) in the bundle; default, and for letters that it lacks: this machine's.", None
    )

    @field_validator("name")
    @classmethod
    def _is_no_command(cls, name: str) -> str:
        if name == NO_CARD:
            raise refusal(f"'{NO_CARD}' takes a card off.", "Give the card another name.")
        return name


def cards_by_name(cards: Sequence[CardConfig]) -> dict[str, CardConfig]:
    """The cards in their order, by name; behind them `blank`, which is black, unless the show has its own."""
    named = {card.name: card for card in cards}
    return named | {BLANK: named.get(BLANK, CardConfig(name=BLANK, background="#000000"))}
