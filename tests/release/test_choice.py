"""Choosing the show: what is new and sound dances, what is broken does not, and something always does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from appliance.box.durable import alone_in
from appliance.release.adoption import adopt, read_choice
from appliance.release.arrivals import look
from appliance.release.choice import (
    APPLIANCE_BOX,
    CHOSEN,
    EMBEDDED_SHOW,
    Aside,
    Choice,
    ShowAndBox,
    box_of,
    write_whole,
)
from appliance.release.shelf import Shelf, UnreadableError
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from tests.release.venue import BROKEN, Venue, dancing


def test_without_anything_the_show_that_comes_with_the_box_dances(venue: Venue) -> None:
    outcome = venue.look()
    assert outcome.choice.complete().first == ShowAndBox(EMBEDDED_SHOW, APPLIANCE_BOX, good=True)
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
        choice.with_good(choice.first.id).write(venue.folders.data / CHOSEN)
    venue.bring(venue.stick, "autumn")
    pairs = venue.look().choice.complete().pairs
    assert [(pair.show / "show.yaml").read_text() for pair in pairs[:2]] == ["autumn", "summer"]
    assert pairs[-1].show == EMBEDDED_SHOW
    kept = {path.name for path in (venue.folders.data / "shows").iterdir()}
    assert {pair.show_id for pair in pairs[:2]} <= kept


def test_a_show_before_that_never_danced_is_better_than_none(venue: Venue) -> None:
    for text in ("spring", "summer"):
        venue.bring(venue.stick, text)
        venue.look()
    pairs = read_choice(venue.folders.data).pairs
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
    refused = (venue.folders.data / "refusals" / "stick.txt").read_text()
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
    assert not (venue.folders.data / "refusals" / "stick.txt").exists()


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
    data, run = venue.folders
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
    (venue.folders.data / name).write_bytes(torn)
    assert dancing(venue.look()) == "spring"
    assert Choice.read(venue.folders.data / CHOSEN) is not None


def test_a_show_that_is_gone_from_the_disk_is_not_chosen(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    first = venue.look().choice.first
    (first.show / "show.yaml").unlink()
    (venue.stick / "show").rename(venue.stick / "gone")
    assert venue.look().choice.complete().first.show == EMBEDDED_SHOW


def test_what_comes_with_the_box_follows_the_release(venue: Venue, tmp_path: Path) -> None:
    venue.bring(venue.stick, "", box="outputs: {osc: []}")
    venue.look()
    path = venue.folders.data / CHOSEN
    path.write_text(path.read_text().replace(str(EMBEDDED_SHOW), str(tmp_path / "an older release")))
    assert read_choice(venue.folders.data).first.show == EMBEDDED_SHOW


def test_a_pair_put_aside_is_not_taken_again_from_the_same_stick(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    choice = venue.look().choice
    aside = Choice(aside=(Aside(choice.first.id, "It did not dance."),))
    choice.without(aside).write(venue.folders.data / CHOSEN)
    again = venue.look()
    assert again.choice.complete().first.show == EMBEDDED_SHOW
    assert (again.choice.refused, again.choice.aside) == ((), aside.aside)
    venue.bring(venue.stick, "mended")
    assert dancing(venue.look()) == "mended"


def test_a_choice_is_read_as_it_was_written(tmp_path: Path) -> None:
    pair = ShowAndBox(tmp_path / "show", tmp_path / "box.yaml", "a+b", "show from the stick", True)
    aside = (Aside("c+", "It did not dance."),)
    choice = Choice((pair, ShowAndBox(good=True)), ("refused",), aside, tmp_path)
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


NO_TEXT = os.fsdecode(b"\xff\xfe.bvh")


def _power_on(venue: Venue) -> str:
    """What dances, and is good from then on."""
    choice = venue.look().choice
    choice.with_good(choice.first.id).write(venue.folders.data / CHOSEN)
    return (choice.first.show / "show.yaml").read_text()


def test_what_gave_way_to_newer_shows_does_not_come_back_from_the_boot_partition(venue: Venue) -> None:
    venue.bring(venue.boot, "autumn, last year")
    _power_on(venue)
    for text in ("spring", "summer"):
        venue.bring(venue.stick, text)
        assert _power_on(venue) == text
    assert [_power_on(venue) for _ in range(3)] == ["summer"] * 3
    (venue.stick / "show").rename(venue.stick / "gone")
    assert _power_on(venue) == "summer"


@pytest.mark.parametrize("boot_show", ["", "from the boot partition"])
def test_a_show_from_the_stick_goes_with_the_box_file_from_the_boot_partition(
    venue: Venue, boot_show: str
) -> None:
    venue.bring(venue.stick, "spring")
    venue.bring(venue.boot, boot_show, box="sensors: {udp: {port: 9751}}")
    outcome = venue.look()
    assert outcome.taken and dancing(outcome) == "spring"
    assert outcome.choice.first.box_id, "at the first power-on the venue's box file was passed over"
    assert not venue.look().taken
    assert dancing(venue.look()) == "spring"


def test_a_show_put_aside_does_not_come_back_once_another_one_is_there(venue: Venue) -> None:
    venue.bring(venue.boot, "never danced")
    choice = venue.look().choice
    aside = Choice(aside=(Aside(choice.first.id, "It did not dance."),))
    choice.without(aside).write(venue.folders.data / CHOSEN)
    venue.bring(venue.stick, "spring")
    assert [_power_on(venue) for _ in range(3)] == ["spring"] * 3


def test_a_show_that_was_lost_comes_back_also_after_a_pulled_stick(venue: Venue) -> None:
    venue.bring(venue.boot, "before")
    _power_on(venue)
    venue.bring(venue.stick, "spring")
    first = venue.look().choice.first
    (first.show / "show.yaml").unlink()
    arrival = look("stick", venue.stick)
    network = venue.stick / "show" / "puppet.onnx"
    network.rename(venue.stick / "away")
    assert adopt(venue.folders, [arrival], venue._check).choice.first.id != first.id
    (venue.stick / "away").rename(network)
    assert dancing(venue.look()) == "spring"


def test_what_is_refused_beside_a_running_show_is_checked_again_at_power_on(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    arrivals = [look("stick", venue.stick)]
    late = adopt(venue.folders, arrivals, lambda show, box: ["It did not end in time."], late=True)
    assert not late.taken
    assert "did not end" in (venue.folders.data / "refusals" / "stick.txt").read_text()
    assert dancing(venue.look()) == "spring"
    assert not (venue.folders.data / "refusals" / "stick.txt").exists()


def test_the_same_show_again_is_as_good_as_before(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    _power_on(venue)
    os.utime(venue.stick / "show" / "show.yaml", (0, 0))  # copied once more, on a machine in 1970
    assert venue.look().choice.first.good


def test_a_good_show_that_does_not_dance_tonight_is_tried_again_after_power_off(tmp_path: Path) -> None:
    good, new = ShowAndBox(id="good+", good=True), ShowAndBox(id="new+")
    aside = (Aside("good+", "Not danced."), Aside("new+", "Nor this."))
    kept = Choice((good, new)).without(Choice(aside=aside))
    assert (kept.pairs, kept.aside) == ((good,), aside[1:])


@pytest.mark.parametrize("content", ["spring", BROKEN])
def test_a_name_that_is_no_text_stops_nobody(venue: Venue, content: str) -> None:
    venue.bring(venue.stick, content)
    (venue.stick / "show" / NO_TEXT).write_bytes(b"1")
    said = adopt(
        venue.folders, [look("stick", venue.stick)], lambda show, box: [f"{show / NO_TEXT}: what is this?"]
    )
    for message in (*said.messages, *said.choice.refused):
        message.encode()
    venue.bring(venue.stick, "mended")
    assert dancing(venue.look()) == "mended"


def test_a_show_that_is_a_link_is_none(venue: Venue) -> None:
    (venue.stick / "show").symlink_to("/usr")
    assert look("stick", venue.stick).listing == []


def test_a_folder_without_end_is_listed_in_a_moment(venue: Venue) -> None:
    for number in range(5000):
        (venue.stick / "show" / f"{number}").mkdir(parents=True)
        (venue.stick / "show" / f"{number}" / "file").touch()
    arrival = look("stick", venue.stick)
    assert arrival.listing == [["show/?", 0, 0]], "5000 folders are looked at before the first file"
    assert "cannot be read" in " ".join(venue.look().messages)


def test_a_file_that_goes_on_for_ever_is_left_early(venue: Venue) -> None:
    venue.bring(venue.stick, "spring")
    arrival = look("stick", venue.stick)
    with (venue.stick / "show" / "puppet.onnx").open("ab") as grown:
        grown.truncate(1 << 40)
    with pytest.raises(UnreadableError, match="goes on after all of 300000 bytes"):
        Shelf(venue.folders.data).take_show(arrival)
    assert not list((venue.folders.data / "shows").iterdir())


@pytest.mark.programs
def test_memory_is_never_filled_by_a_show(venue: Venue) -> None:
    """The place, the journal and the choice itself have to find room there."""
    run, shm = venue.folders.run, ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs"]
    venue.folders.data.rmdir()
    venue.folders.data.symlink_to("/nowhere/at/all")
    if subprocess.run([*shm, str(run)], capture_output=True, check=False).returncode:
        pytest.skip("this user may not mount a file system")
    try:
        venue.bring(venue.stick, "spring")
        assert not venue.look().taken
        assert "no room" in " ".join(venue.look().messages)
    finally:
        subprocess.run(["umount", str(run)], check=True)


_AS_THE_BOX = """
import os
from pathlib import Path
from appliance.release.choice import Aside, Choice
os.setuid(990)
choice = Choice.read(Path({file!r}))
print([one.is_there for one in choice.pairs], choice.complete().first.id)
"""


def test_what_root_has_left_behind_for_itself_is_not_there(venue: Venue) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can leave root's files behind")
    venue.bring(venue.stick, "spring")
    first = venue.look().choice.first
    first.show.chmod(0o700)
    copied = Path("/tmp") / f"bunraku-{os.getpid()}.json"
    try:
        Choice((first,)).write(copied)
        copied.chmod(0o644)
        asked = _AS_THE_BOX.format(file=str(copied))
        done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=False)
    finally:
        copied.unlink()
    assert done.stdout == "[False] \n", done.stderr


def test_a_reader_that_hangs_holds_up_nobody_once_its_preflight_has_given_up(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    with alone_in(tmp_path):
        child = os.fork()
        if child == 0:
            os.close(writing)
            os.read(reading, 1)  # as on a stick that does not answer
            os._exit(0)
        with pytest.raises(BlockingIOError), alone_in(tmp_path):
            raise AssertionError("two at once")
    with alone_in(tmp_path):
        pass
    os.write(writing, b"!")
    os.waitpid(child, 0)
    os.close(reading)
    os.close(writing)


def test_nothing_is_remembered_of_nothing(tmp_path: Path) -> None:
    assert read_choice(tmp_path / "none").pairs == ()
