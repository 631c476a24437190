"""Shared by pictures: colours as they are written in YAML, and image files of a bundle."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, ValidationInfo

from appliance.pose.foreign_file import opened
from appliance.show.section import BundleFile, refusal

_SIGNATURES = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


def _given(value: object) -> object:
    if value is None or isinstance(value, int):
        raise refusal(
            "This colour is empty: after a # YAML reads a comment, and only digits make a number.",
            "Write it in quotes, for instance '#f2e6d8', or leave the key out for the look's own colour.",
        )
    return value


def _hexadecimal(colour: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", colour):
        raise refusal(
            f"'{colour}' is not a colour.",
            "Write red, green and blue in two hexadecimal digits each, in quotes: '#f2e6d8'.",
        )
    return colour.lower()


def _png_or_jpeg(name: str, info: ValidationInfo) -> str:
    directory = (info.context or {}).get("directory")
    if directory is not None:
        with opened(Path(directory, name)) as file:
            begin = file.read(8)
        if not begin.startswith(_SIGNATURES):
            raise refusal(f"'{name}' is neither a PNG nor a JPEG file.", "Save the image as one of them.")
    return name


Colour = Annotated[Annotated[str, AfterValidator(_hexadecimal)] | None, BeforeValidator(_given)]
PictureFile = Annotated[BundleFile, AfterValidator(_png_or_jpeg)]
