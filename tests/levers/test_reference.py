"""docs/osc.md and the keys of cues are what the table of levers says."""

from __future__ import annotations

from pathlib import Path

import annotated_types

from appliance.levers.addresses import ADDRESSES, LISTS
from appliance.levers.reference import written
from appliance.levers.table import LEVERS
from appliance.outputs.shared_frame import Facts
from appliance.show.cues import CueConfig

PAGE = Path(__file__).resolve().parents[2] / "docs" / "osc.md"


def test_the_tables_of_the_page_are_not_stale() -> None:
    page = PAGE.read_text("utf-8")
    assert page == written(page), "docs/osc.md is stale. Run: python -m appliance.levers.reference"


def test_each_key_of_a_cue_is_a_levers_within_its_bounds() -> None:
    own = {"name", "at", "motion", "fade_s"}
    assert set(CueConfig.model_fields) == own | {lever.cue for lever in LEVERS if lever.cue}
    for lever in LEVERS:
        if lever.cue and lever.kind.numbers and not lever.kind.text and len(lever.kind.numbers) == 1:
            rules = CueConfig.model_fields[lever.cue].metadata
            least = next(rule.ge for rule in rules if isinstance(rule, annotated_types.Ge))
            most = next(rule.le for rule in rules if isinstance(rule, annotated_types.Le))
            assert (least, most) == lever.kind.numbers[0][1:3]


def test_names_are_those_of_a_show_and_addresses_differ() -> None:
    known = set(Facts.__dataclass_fields__)
    named = [lever for lever in LEVERS if lever.names != ("", "")]
    assert {lever.names[0] for lever in named} <= known
    assert {lever.needs.among for lever in LEVERS if lever.needs} <= known
    assert set(LISTS.values()) <= set(named)
    addresses = [lever.address for lever in LEVERS if lever.address]
    assert len(addresses) == len(set(addresses)) and set(addresses) <= set(ADDRESSES)
