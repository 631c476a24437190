"""The roster of the sensors over the real port, and their keys read anew."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from appliance.sensor.keys import create_keys, load_keys
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, until


def test_the_roster_is_told_as_the_stage_saw_it_last(
    stage: StageDouble, asker: Asker, key_file: Path
) -> None:
    line = ["left-wrist", "1a2b3c4d", "linked", "10.0.0.7:2390", 50.0, 0.5, 0.25, -1.0, 87, 51, 1]
    texts = ["1.0.0", "00112233445566778899aabbccddeeff", "taken", ""]
    stage.tell(sensors=[line + texts], looked_at=time.monotonic() - 5.0)
    sensor, end = asker.ask_all("/sensors/list")
    assert sensor == ["/sensors/sensor", *line, *texts, 0.0, -1.0]
    assert end[:2] == ["/sensors/end", 1]
    assert 5.0 <= end[2] < 65.0
    assert end[3] == str(key_file)
    stage.tell(looked_at=time.monotonic() + 60.0)  # after show control, held up for a moment, read its clock
    assert asker.ask_all("/sensors/list")[-1][2] == 0.0


def test_the_roster_of_a_box_that_is_starting_and_of_none(folder: Path, key_file: Path, asker: Asker) -> None:
    [reply] = asker.ask_all("/sensors/list")
    assert reply[:3] == ["/sensors/reply", "/sensors/list", 0]
    assert "No stage dances on this box" in reply[3]
    with StageDouble(folder):
        until(lambda: asker.ask_all("/sensors/list") == [["/sensors/end", 0, -1.0, str(key_file)]])


def test_a_reload_brings_the_keys_along(stage: StageDouble, asker: Asker, key_file: Path) -> None:
    assert asker.ask("/sensors/reload") == ["/sensors/reply", "/sensors/reload", 1, "reload it is."]
    [order] = stage.orders
    assert order.keys == {name: (one.device_id, one.key) for name, one in load_keys(key_file).items()}
    key_file.unlink()
    create_keys(key_file, ["left-wrist", "spare-1", "spare-2"])
    asker.ask("/sensors/reload")
    assert len(stage.orders[-1].keys) == 3


def test_a_key_file_that_has_not_changed_is_not_read_again(
    stage: StageDouble, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[Path] = []

    def read(path: Path) -> dict[str, object]:
        reads.append(path)
        return dict(load_keys(path))

    monkeypatch.setattr("appliance.sensor.keys.load_keys", read)
    for _ in range(5):
        asker.ask("/sensors/reload")
    assert (len(reads), len(stage.orders)) == (1, 5)


@pytest.mark.parametrize(
    ("text", "complaint"), [("left-wrist: {", "not valid YAML here"), (None, "No such file")]
)
def test_a_reload_of_a_bad_file_changes_nothing_and_is_told(
    stage: StageDouble, asker: Asker, key_file: Path, text: str | None, complaint: str
) -> None:
    key_file.write_text(text) if text is not None else key_file.unlink()
    _, about, done, message = asker.ask("/sensors/reload")
    assert (about, done) == ("/sensors/reload", 0)
    assert complaint in message
    assert "goes on with the keys that it has" in message
    assert stage.orders == []


def test_a_box_without_a_key_file_says_so(folder: Path) -> None:
    control = ControlInThread(folder)
    asker = Asker(control.port)
    assert "no key file" in asker.ask("/sensors/reload")[3]
    asker.close()
    control.close()
