"""Looks in show.yaml: colours, and messages about invalid ones."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from appliance.projector.picture.looks.palette import palette
from appliance.show.look import STYLES, LookConfig, looks_by_name


def test_without_looks_there_are_the_built_in_ones_plaster_first() -> None:
    looks = looks_by_name(())
    assert tuple(looks) == STYLES and STYLES[0] == "plaster"


def test_colours_are_the_styles_own_where_the_show_says_none() -> None:
    own, given = palette(LookConfig(name="a")), palette(LookConfig(name="a", figure="#FF8000"))
    assert given.figure == pytest.approx([1.0, 0.25, 0.0], abs=0.01)
    assert (given.light == own.light).all()


@pytest.mark.parametrize("colour", ["red", "#12345", "#1234567", "#12345g", ""])
def test_what_is_no_colour(colour: str) -> None:
    with pytest.raises(ValidationError, match="is not a colour"):
        LookConfig(name="a", figure=colour)


@pytest.mark.parametrize("colour", [None, 102030])
def test_colour_that_yaml_took_for_something_else(colour: object) -> None:
    with pytest.raises(ValidationError, match="reads a comment"):
        LookConfig.model_validate({"name": "a", "light": colour})
