"""Sentences of the box in other languages: the table follows the source."""

from __future__ import annotations

import re

import pytest

from tools.page_sentences import SENTENCES, templates, translated

LANGUAGES = sorted(path.stem for path in SENTENCES.glob("*.json"))
MOST_MISSING = 0.05  # of the sentences: those stay English until somebody translates them


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_box_s_sentences_are_translated(language: str) -> None:
    """`python -m tools.page_sentences` lists what is missing."""
    table, known = translated(language), templates()
    assert len(known) > 200
    missing = [one for one in known if one not in table]
    assert len(missing) <= MOST_MISSING * len(known), missing


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_translation_fills_in_what_the_sentence_has(language: str) -> None:
    for sentence, own in translated(language).items():
        assert sorted(re.findall(r"\{\w+\}", own)) == sorted(re.findall(r"\{\w+\}", sentence)), sentence


def test_each_language_of_the_page_has_the_same_sentences() -> None:
    """But English, in which the box speaks; so that no page is half in another language."""
    pages = {path.stem for path in SENTENCES.parent.glob("*.json")} - {"en"}
    assert set(LANGUAGES) == pages
    first, *others = (translated(language) for language in LANGUAGES)
    assert all(first.keys() == other.keys() for other in others)
