"""Complete files of a show and a venue with a rig: each fault is reported with file, line and cure."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show.venue_rig import misplaced, unwired

SHOW = """\
name: Rig
hands:
  - {sensor: left-wrist, joint: lShldr}
looks:
  - {name: marble, style: plaster}
lights:
  fixtures:
    - name: spot left
      profile: moving-spot
      universe: 1
      address: 1
    - name: wash
      profile: led-par
      universe: 1
      address: 101
  mappings:
    - name: warm
      rules:
        - reads: speed
          drives: dimmer
          fixtures: [wash]
  safe: {dimmer: 0.2, fixtures: [wash]}
cues:
  - name: opening
    look: marble
    lights: warm
"""
BOX = """\
outputs:
  osc:
    - {port: 9004}
  dmx:
    - universe: 1
      wire: artnet
      host: 10.0.0.5
    - universe: 2
      wire: sacn
      channels: 512
control:
  port: 9002
"""


def line_of(text: str, message: str) -> int:
    """Number of the first line with these words."""
    return next(number for number, line in enumerate(text.splitlines(), 1) if message in line)


def test_the_files_are_sound_without_the_faults(bundle: Path) -> None:
    (bundle / "show.yaml").write_text(SHOW)
    (bundle / "box.yaml").write_text(BOX)
    assert load_show(bundle).config.cues[0].lights == "warm"
    assert len(load_box(bundle / "box.yaml").outputs.dmx) == 2


@pytest.mark.parametrize(
    ("sound", "fault", "line", "words"),
    [
        ("universe: 1", "universe: 64000", 10, ["is 64000, out of range", "0 to 63999"]),
        ("universe: 1", "universe: -1", 10, ["is -1, out of range"]),
        ("address: 101", "address: 513", 15, ["is 513, out of range", "Write 1 to 512."]),
        ("address: 101", "address: 0", 15, ["is 0, out of range"]),
        ("address: 101", "address: 101\n      place: [0, 3, 1001]", 16, ["is 1001, out of range"]),
        ("address: 101", "address: 101\n      turn: [400, 0, 0]", 16, ["is 400, out of range"]),
        ("address: 101", "address: 512", 15, ["'wash' takes", "a universe has 512"]),
        ("address: 101", "address: 2", 12, ["'spot left' and 'wash' are both on channel 2"]),
        ("name: wash", "name: spot left", 12, ["Two fixtures are called 'spot left'"]),
        ("profile: led-par", "profile: led-pra", 13, ["Did you mean 'led-par'?"]),
        ("fixtures: [wash]", "fixtures: [wahs]", 19, ["no fixture 'wahs'", "Did you mean 'wash'?"]),
        ("drives: dimmer", "drives: dimer", 19, ["'dimer'", "Did you mean 'dimmer'?"]),
        ("reads: speed", "reads: velocity", 19, ["not one of place, across", "place (for aim), across"]),
        (
            "reads: speed",
            "reads: speed\n          colours: [[255, 0, 0]]",
            20,
            ["[0]' is 255, out of range. Write at most 1."],
        ),
        ("reads: speed", "reads: spede", 19, ["Did you mean 'speed'?"]),
        ("look: marble", "look: marbel", 25, ["no look 'marbel'", "Did you mean 'marble'?"]),
        ("lights: warm", "lights: wram", 26, ["mappings 'wram'", "Did you mean 'warm'?"]),
    ],
)
def test_a_fault_of_the_rig_is_named_with_its_line(
    bundle: Path, sound: str, fault: str, line: int, words: list[str]
) -> None:
    (bundle / "show.yaml").write_text(SHOW.replace(sound, fault, 1))
    with pytest.raises(ConfigError) as caught:
        load_show(bundle)
    problem = caught.value.problems[0]
    assert (problem.file, problem.line) == (bundle / "show.yaml", line)
    for word in words:
        assert word in str(problem)


@pytest.mark.parametrize(
    ("sound", "fault", "words"),
    [
        ("universe: 2", "universe: 0", ["sACN has universes from 1 to 63999", "0 is none"]),
        ("universe: 2", "universe: 64000", ["sACN has universes from 1 to 63999", "64000"]),
        ("universe: 1", "universe: 32768", ["Art-Net has universes from 0 to 32767"]),
        ("channels: 512", "channels: 513", ["is 513, out of range", "Write 24 to 512."]),
        ("wire: sacn", "wire: scan", ["Did you mean 'sacn'?"]),
        ("channels: 512", "priority: 201", ["is 201, out of range", "Write 0 to 200."]),
        ("channels: 512", "chanels: 512", ["Unknown key 'chanels'", "Did you mean 'channels'?"]),
        ("channels: 512", "device: /dev/ttyUSB0", ["'device' belongs to usb-pro and open-dmx"]),
        ("host: 10.0.0.5", "host: node.local", ["is not an IPv4 address"]),
        ("port: 9002", "host: 0.0.0.0", ["no sender may command", "senders"]),
        (
            "port: 9002",
            "senders: [10.0.0.5]",
            ["10.0.0.5 may command", "this machine only", "`host: 0.0.0.0`"],
        ),
        ("port: 9002", "port: 9750", ["Commands and sensors cannot both arrive on port 9750"]),
    ],
)
def test_a_fault_of_the_venue_is_named_with_its_line(
    tmp_path: Path, sound: str, fault: str, words: list[str]
) -> None:
    text = BOX.replace(sound, fault, 1)
    (tmp_path / "box.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_box(tmp_path / "box.yaml")
    (problem,) = caught.value.problems
    assert (problem.file, problem.line) == (tmp_path / "box.yaml", line_of(text, fault))
    for word in words:
        assert word in str(problem)


def test_two_wires_to_the_same_place_are_refused(tmp_path: Path) -> None:
    text = BOX.replace("wire: sacn", "wire: artnet\n      host: 10.0.0.5").replace(
        "universe: 2", "universe: 1"
    )
    (tmp_path / "box.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"dmx\[0\] and dmx\[1\] send to the same place") as caught:
        load_box(tmp_path / "box.yaml")
    assert caught.value.line == 8


def test_faults_of_the_rig_and_of_other_sections_are_reported_together(bundle: Path) -> None:
    text = SHOW.replace("address: 101", "address: 513").replace("style: plaster", "style: plastre")
    (bundle / "show.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_show(bundle)
    assert [problem.line for problem in caught.value.problems] == [
        line_of(text, "plastre"),
        line_of(text, "513"),
    ]


@pytest.mark.parametrize(
    ("places", "line", "words"),
    [
        ("{fixture: wahs, address: 7}", 3, ["no fixture 'wahs'", "Did you mean 'wash'?"]),
        ("{fixture: wash, address: 3}", 3, ["are both on channel 3 of universe 1"]),
        ("{fixture: wash, address: 512}", 3, ["'wash' would end on channel", "a universe has 512"]),
        ("{fixture: wash, address: 7}\n    - {fixture: spot left, address: 5}", 3, ["are both on channel"]),
    ],
)
def test_a_venue_that_hangs_fixtures_where_they_do_not_fit_is_refused(
    bundle: Path, places: str, line: int, words: list[str]
) -> None:
    (bundle / "show.yaml").write_text(SHOW)
    (bundle / "box.yaml").write_text(f"lights:\n  places:\n    - {places}\n")
    (problem,) = misplaced(load_show(bundle), load_box(bundle / "box.yaml"))
    assert (problem.file, problem.line) == (bundle / "box.yaml", line)
    for word in words:
        assert word in str(problem)


def test_a_venue_may_change_the_rig(bundle: Path) -> None:
    (bundle / "show.yaml").write_text(SHOW)
    (bundle / "box.yaml").write_text("lights: {places: [{fixture: wash, universe: 7, address: 1}]}\n")
    show, box = load_show(bundle), load_box(bundle / "box.yaml")
    assert misplaced(show, box) == []
    assert [sentence[:23] for sentence in unwired(show.config, box)] == [
        "Universe 1 has no wire,",
        "Universe 7 has no wire,",
    ]
