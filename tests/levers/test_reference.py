"""docs/osc.md and the keys of cues are what the table of levers says."""

from __future__ import annotations

import os
import subprocess
import sys
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


ROOT = Path(__file__).resolve().parents[2]
ENTRIES = """
HAZE = Lever(
    "haze",
    kind.number("amount", 0, 1),
    0.0,
    "how much haze there is",
    "/haze",
    1.5,
    cue="haze",
    follower="stage",
    said=lambda amount, s: f"The haze goes to {100 * amount:.0f} % over {s:g} s.",
)
VEIL = Lever(
    "veil",
    kind.name("veil", "none"),
    "",
    "which veil hangs before the stage",
    "/veil",
    cue="veil",
    names=("looks", "veil"),
    stays=True,
)
"""
USE = """
from pathlib import Path

from appliance.levers.reference import written
from appliance.levers.show_state import ShowState, packed, unpacked
from appliance.levers.table import HAZE, VEIL, find_lever
from appliance.show_control.command import command
from appliance.show_control.show_state_commands import declare, of_this_show
from tests.show_control.doubles import facts

NOW = 100.0
show = facts(cues=({"name": "mist", "haze": 0.25, "veil": "ink", "fade_s": 4.0},))


def say(state, address, *arguments):
    return declare(state, command(address, arguments), show, NOW)


for wrong in ((1.5,), ("much",), ()):
    try:
        command("/haze", wrong)
    except ValueError as error:
        assert str(error) == "/haze takes amount (0 to 1), [fade in seconds (0 to 60)].", error
    else:
        raise AssertionError(wrong)
state, words = say(ShowState(show="A test"), "/haze", 0.5)
assert words == "The haze goes to 50 % over 1.5 s."
assert state.generation == state[HAZE].generation > 0, "the reply waits for the stage"
assert state[HAZE].level(NOW + 0.75) == 0.25
assert HAZE.formatted(state[HAZE]) == ("", (0.5, 1.5)), "as the journal notes the order"
state, _ = say(state, "/cue", "mist")
assert (state[HAZE].value, state[HAZE].seconds) == (0.25, 4.0)
assert state[VEIL].value == "ink"
assert unpacked(packed(state)) == state and find_lever("haze") is HAZE
try:
    say(state, "/veil", "inc")
except ValueError as error:
    assert "This show has no veil 'inc'. Did you mean 'ink'?" in str(error), error
else:
    raise AssertionError
other = of_this_show(state, facts(show_name="Another", looks=("lines",)))
assert HAZE not in other and other[VEIL].value == ""
page = written((Path(ROOT) / "docs" / "osc.md").read_text("utf-8"))
assert "| `/haze` | amount (0 to 1), [fade in seconds; 1.5] | how much haze there is |" in page
print("well")
"""


def test_an_entry_of_the_table_is_all_that_a_lever_needs(tmp_path: Path) -> None:
    """In a copy of the program whose table has two entries more."""
    (tmp_path / "appliance" / "levers").mkdir(parents=True)
    for one in (ROOT / "appliance").iterdir():
        if one.name not in ("levers", "__pycache__"):
            (tmp_path / "appliance" / one.name).symlink_to(one)
    for one in (ROOT / "appliance" / "levers").glob("*.py"):
        (tmp_path / "appliance" / "levers" / one.name).write_text(one.read_text("utf-8"), "utf-8")
    table = tmp_path / "appliance" / "levers" / "table.py"
    before, _, after = table.read_text("utf-8").partition("LEVERS: tuple[Lever[Any], ...] = (\n")
    table.write_text(f"{before}{ENTRIES}\nLEVERS: tuple[Lever[Any], ...] = (\n    *(HAZE, VEIL),\n{after}")
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    done = subprocess.run(
        [sys.executable, "-c", f"ROOT = {str(ROOT)!r}\n{USE}"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "well\n", done.stderr
