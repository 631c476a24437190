"""The one sentence: which it is, and that each has its words in each language."""

from __future__ import annotations

import json
import re
import time
from collections import defaultdict
from typing import Any

import pytest

from appliance.console.server import FOLDER, languages
from appliance.console.verdict import verdict
from appliance.levers.status import Status
from hw_sim.figures import verdict as verdict_of_measure

GOOD = Status(state="dancing", rate_hz=50.0, level=1.0)
HEARD = {"name": "left-wrist", "is_worn": True, "heard": True}
LOST = {"name": "right-wrist", "is_worn": True, "heard": False}
SPARE = {"name": "spare", "is_worn": False, "heard": False}
FELL = {"name": "receiver-gone", "active": True, "message": "A receiver is away."}
TRANSLATED = [language for language in languages() if language != "en"]
NOW, HOUR_AGO = 0.0, 3600.0  # seconds since a tick was late


def status(**values: Any) -> Status:
    return GOOD._replace(**values)


@pytest.mark.parametrize(
    ("frames", "reported", "sensors", "fallbacks", "ago_s", "trouble", "level", "key"),
    [
        ("fresh", status(), [HEARD, SPARE], [], HOUR_AGO, "", "well", "well"),
        ("fresh", status(), [SPARE], [], HOUR_AGO, "", "well", "well_alone"),
        ("absent", status(), [HEARD], [], HOUR_AGO, "", "fault", "stage_absent"),
        ("stale", status(), [HEARD], [], HOUR_AGO, "", "fault", "stage_hung"),
        ("fresh", None, [], [], HOUR_AGO, "It is silent.", "fault", "no_control"),
        ("fresh", status(panic=1, state="panic"), [LOST], [FELL], HOUR_AGO, "", "held", "panic"),
        ("fresh", status(blackout=1, state="blackout"), [HEARD], [], HOUR_AGO, "", "held", "blackout"),
        ("fresh", status(state="stopped"), [HEARD], [], HOUR_AGO, "", "held", "stopped"),
        ("fresh", status(level=0.0), [HEARD], [], HOUR_AGO, "", "held", "dark"),
        ("fresh", status(), [HEARD, LOST], [FELL], HOUR_AGO, "", "warning", "sensors_missing"),
        ("fresh", status(), [HEARD], [FELL], HOUR_AGO, "", "warning", "fallbacks"),
        ("fresh", status(), [HEARD], [{**FELL, "active": False}], HOUR_AGO, "", "well", "well"),
        ("fresh", status(late=2), [HEARD], [], NOW, "", "warning", "late"),
        ("fresh", status(late=2), [HEARD], [], HOUR_AGO, "", "well", "well"),
    ],
)
def test_the_worst_comes_first(
    frames: str, reported: Any, sensors: Any, fallbacks: Any, ago_s: float, trouble: str, level: str, key: str
) -> None:
    said = verdict(frames, reported, sensors, fallbacks, time.time() - ago_s, trouble)
    assert (said.level, said.key) == (level, key)
    for language in languages():
        sentence = table(language)[f"verdict_{key}"]
        assert set(re.findall(r"\{(\w+)\}", sentence)) <= set(said.values), "a value that nothing fills in"


def test_missing_sensors_are_named() -> None:
    assert verdict("fresh", status(), [HEARD, LOST], [], HOUR_AGO, "").values["names"] == "right-wrist"


@pytest.mark.parametrize("language", languages())
def test_each_language_knows_the_words_of_the_page(language: str) -> None:
    """With the same values in the same sentences."""
    english, own = table("en"), table(language)
    assert english.keys() == {key for key in own if not key.startswith(("fallback_", "named_"))}
    for key, sentence in english.items():
        assert set(re.findall(r"\{\w+\}", sentence)) == set(re.findall(r"\{\w+\}", own[key])), key
    page = (FOLDER / "index.html").read_text()
    scripts = "".join(path.read_text() for path in FOLDER.glob("*.js"))
    asked = set(re.findall(r'data-(?:words|label)="(\w+)"', page)) | set(
        re.findall(r'words\("(\w+)"', scripts)
    )
    assert len(asked) > 100 and asked <= english.keys()


@pytest.mark.parametrize("language", TRANSLATED)
def test_each_translation_has_each_fallback(language: str) -> None:
    from tests.stage.test_fallbacks import EVERY

    assert not [key for key in table("en") if key.startswith(("fallback_", "named_"))], "the box has these"
    said = {key for key in table(language) if key.startswith(("fallback_", "named_"))}
    named = {f"named_{name}" for name, row in EVERY.items() if row.named}
    assert {key for key in said if key.startswith("fallback_")} == {f"fallback_{name}" for name in EVERY}
    assert named <= said
    assert all("{about}" in table(language)[key] for key in named & said)


@pytest.mark.parametrize("language", languages())
def test_each_language_has_the_limits_of_a_measurement(language: str) -> None:
    """As certificate.js asks for them."""
    nothing = dict.fromkeys(("p50", "p99"))
    numbers = dict.fromkeys(("late_ticks", "missing_frames", "ticks", "firmware"), 0)
    figures = defaultdict(lambda: nothing, **numbers, rss_mb=None, start_to_first_frame_s=None)
    figures["hand_to_light_ms"] = figures["hand_to_sound_ms"] = nothing
    for limit in verdict_of_measure(figures):
        key = f"limit_{re.sub(r'[^a-z0-9]+', '_', limit.label.lower())}"
        assert key in table(language), key
        if language == "en":
            assert table("en")[key] == limit.label


def table(language: str) -> dict[str, str]:
    found: dict[str, str] = json.loads((FOLDER / "words" / f"{language}.json").read_text())
    return found
