"""Choosing the show: what is new and sound dances, what is broken does not, and something always does."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from appliance.release.adoption import read_choice
from appliance.release.choice import (
    APPLIANCE_BOX,
    CHOSEN,
    EMBEDDED_SHOW,
    Aside,
    Choice,
    Pair,
    box_of,
    write_whole,
)
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from tests.release.venue import BROKEN, Venue, dancing


def test_without_anything_the_show_that_comes_with_the_box_dances(venue: Venue) -> None:
    outcome = venue.look()
    assert outcome.choice.complete().first == Pair(EMBEDDED_SHOW, APPLIANCE_BOX, good=True)
    assert (outcome.taken, outcome.messages, venue.checked) == (False, (), [])


def test_a_new_show_is_copied_whole_and_dances_also_without_its_stick(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    assert venue.look().taken
    show = venue.look().choice.first.show
    for name in ("show.yaml", "puppet.onnx", "profiles/head.yaml"):
        assert (show / name).read_bytes() == (venue.stick / "show" / name).read_bytes()
    (venue.stick / "show").rename(venue.stick / "gone")
    assert dancing(venue.look()) == "spring"


def test_nothing_new_is_not_checked_again(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    venue.look()
    checked = len(venue.checked)
    assert not venue.look().taken
    assert len(venue.checked) == checked == 1


def test_the_show_before_is_kept_once_it_has_danced(venue: Venue) -> None:
    for text in ("spring", "summer"):
        venue.bring(venue.stick, text)
        choice = venue.look().choice
        choice.with_good(choice.first.id).write(venue.places.data / CHOSEN)
    venue.bring(venue.stick, "autumn")
    pairs = venue.look().choice.complete().pairs
    assert [(pair.show / "show.yaml").read_text() for pair in pairs[:2]] == ["autumn", "summer"]
    assert pairs[-1].show == EMBEDDED_SHOW
    kept = {path.name for path in (venue.places.data / "shows").iterdir()}
    assert {pair.show_id for pair in pairs[:2]} <= kept


def test_a_show_before_that_never_danced_is_better_than_none(venue: Venue) -> None:
    for text in ("spring", "summer"):
        venue.bring(venue.stick, text)
        venue.look()
    pairs = read_choice(venue.places.data).pairs
    assert [(pair.show / "show.yaml").read_text() for pair in pairs] == ["summer", "spring"]


def test_a_broken_show_is_refused_with_its_line_on_the_stick_and_the_last_good_one_dances(
    venue: Venue,
) -> None:
    venue.bring(venue.stick, "spring")
    venue.look()
    venue.bring(venue.stick, BROKEN)
    outcome = venue.look()
    assert dancing(outcome) == "spring"
    assert f"{venue.stick}/show/show.yaml:1: It says broken. Mend it." in outcome.choice.refused
    refused = (venue.places.data / "refusals" / "stick.txt").read_text()
    assert "what danced before goes on" in refused
    checked = len(venue.checked)
    again = venue.look()
    assert again.choice.refused == outcome.choice.refused
    assert (len(venue.checked), again.messages) == (checked, ())


def test_a_mended_show_is_taken_and_the_refusal_is_gone(venue: Venue) -> None:
    venue.bring(venue.stick, BROKEN)
    venue.look()
    venue.bring(venue.stick, "mended")
    assert dancing(venue.look()) == "mended"
    assert not (venue.places.data / "refusals" / "stick.txt").exists()


def test_a_broken_box_file_does_not_hold_up_a_sound_show(venue: Venue) -> None:
    venue.bring(venue.stick, "spring", box=f"# {BROKEN}")
    outcome = venue.look()
    assert dancing(outcome) == "spring"
    assert outcome.choice.first.box_id == ""
    assert f"{venue.stick}/box.yaml:1: It says broken. Mend it." in outcome.choice.refused


def test_a_broken_show_does_not_hold_up_a_sound_box_file(venue: Venue) -> None:
    venue.bring(venue.stick, BROKEN, box="sensors: {udp: {port: 9751}}")
    first = venue.look().choice.complete().first
    assert first.show == EMBEDDED_SHOW
    udp = load_box(first.box).sensors.udp
    assert udp is not None
    assert (udp.host, udp.port) == ("0.0.0.0", 9751)


def test_a_box_file_gets_from_the_box_what_it_leaves_out(venue: Venue) -> None:
    said = {
        "sensors": {"udp": None},
        "outputs": {"osc": [{"host": "10.0.0.9", "port": 7000}]},
        "runtime": "mine",
    }
    venue.bring(venue.stick, "", box=yaml.safe_dump(said))
    box = load_box(venue.look().choice.first.box)
    data, run = venue.places
    assert box.sensors.udp is None
    assert [one.host for one in box.outputs.osc] == ["10.0.0.9"]
    assert (box.sensors.keys, box.state) == (data / "keys/sensors.keys", data / "state")
    assert box.runtime == run, "the box's processes look nowhere else"


def test_the_stick_goes_before_the_boot_partition_and_stays_chosen_without_it(venue: Venue) -> None:
    venue.bring(venue.stick, "from the stick")
    venue.bring(venue.boot, "from the boot partition")
    assert dancing(venue.look()) == "from the stick"
    (venue.stick / "show").rename(venue.stick / "gone")
    assert dancing(venue.look()) == "from the stick"
    venue.bring(venue.boot, "newer, from the boot partition")
    assert dancing(venue.look()) == "newer, from the boot partition"


def test_a_broken_stick_lets_the_boot_partition_have_its_turn(venue: Venue) -> None:
    venue.bring(venue.stick, BROKEN)
    venue.bring(venue.boot, "from the boot partition")
    outcome = venue.look()
    assert dancing(outcome) == "from the boot partition"
    assert outcome.choice.refused


@pytest.mark.parametrize("torn", [b"", b"{", b'{"pairs": 3}', b"\0" * 400])
@pytest.mark.parametrize("name", [CHOSEN, "seen.json"])
def test_a_torn_file_costs_another_look_at_the_stick_alone(venue: Venue, name: str, torn: bytes) -> None:
    venue.bring(venue.stick, "spring")
    venue.look()
    (venue.places.data / name).write_bytes(torn)
    assert dancing(venue.look()) == "spring"
    assert Choice.read(venue.places.data / CHOSEN) is not None


def test_a_show_that_is_gone_from_the_disk_is_not_chosen(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    first = venue.look().choice.first
    (first.show / "show.yaml").unlink()
    (venue.stick / "show").rename(venue.stick / "gone")
    assert venue.look().choice.complete().first.show == EMBEDDED_SHOW


def test_what_comes_with_the_box_follows_the_release(venue: Venue, tmp_path: Path) -> None:
    venue.bring(venue.stick, "", box="outputs: {osc: []}")
    venue.look()
    path = venue.places.data / CHOSEN
    path.write_text(path.read_text().replace(str(EMBEDDED_SHOW), str(tmp_path / "an older release")))
    assert read_choice(venue.places.data).first.show == EMBEDDED_SHOW


def test_a_pair_put_aside_is_not_taken_again_from_the_same_stick(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    choice = venue.look().choice
    aside = Choice(aside=(Aside(choice.first.id, "It did not dance."),))
    choice.without(aside).write(venue.places.data / CHOSEN)
    again = venue.look()
    assert again.choice.complete().first.show == EMBEDDED_SHOW
    assert (again.choice.refused, again.choice.aside) == ((), aside.aside)
    venue.bring(venue.stick, "mended")
    assert dancing(venue.look()) == "mended"


def test_a_choice_is_read_as_it_was_written(tmp_path: Path) -> None:
    pair = Pair(tmp_path / "show", tmp_path / "box.yaml", "a+b", "show from the stick", True)
    choice = Choice((pair, Pair(good=True)), ("refused",), (Aside("c+", "It did not dance."),), tmp_path)
    choice.write(tmp_path / CHOSEN)
    assert Choice.read(tmp_path / CHOSEN) == choice
    top = json.loads((tmp_path / CHOSEN).read_text())
    assert (top["show"], top["box"], top["id"]) == (str(pair.show), str(pair.box), "a+b")


def test_a_file_that_cannot_be_replaced_stays_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "folder"
    path.mkdir()
    (path / "inside").touch()
    with pytest.raises(OSError):
        write_whole(path, b"new")
    assert [one.name for one in tmp_path.iterdir()] == ["folder"]


def test_box_and_chosen_contradict_each_other(tmp_path: Path) -> None:
    assert box_of(tmp_path, None) == tmp_path
    assert box_of(None, tmp_path / "none.json") == APPLIANCE_BOX
    with pytest.raises(ConfigError, match="not both"):
        box_of(tmp_path, tmp_path / CHOSEN)
