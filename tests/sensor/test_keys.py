"""The key file: made for its owner alone, read with the line of every mistake, and never shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.sensor.keys import KeyFileError, create_keys, exposure, load_keys, unknown_sensor

KEY = "00112233445566778899aabbccddeeff"


def test_a_new_file_is_its_owners_alone_and_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    keys = create_keys(path, ["left-wrist", "odd: name #1", "null"])
    assert path.stat().st_mode & 0o777 == 0o600
    assert exposure(path) is None
    assert load_keys(path) == keys
    assert len({sensor.device_id for sensor in keys.values()}) == 3
    assert len({sensor.key for sensor in keys.values()}) == 3


def test_a_file_that_is_there_is_never_replaced(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    before = create_keys(path, ["a"])
    with pytest.raises(FileExistsError):
        create_keys(path, ["b"])
    assert load_keys(path) == before


def test_a_file_that_others_can_read_is_said(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    create_keys(path, ["a"])
    path.chmod(0o644)
    assert f"chmod 600 {path}" in (exposure(path) or "")


def test_keys_that_look_like_numbers_stay_keys(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    path.write_text(f"a: {{device: 1, key: {'0' * 31}1}}\nb: {{device: 0x2, key: {'1e' * 16}}}\n")
    assert load_keys(path)["a"].key == bytes(15) + b"\x01"
    assert load_keys(path)["b"].key == b"\x1e" * 16


def test_an_empty_file_has_no_sensors(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    path.write_text("# none yet\n")
    assert load_keys(path) == {}


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (f"a: {{device: 1, key: {KEY}}}\nb: {{device: 1, key: {KEY}}}\n", 2, "same device id"),
        (f"a: {{device: 1, key: {KEY}}}\na: {{device: 2, key: {KEY}}}\n", 2, "twice"),
        (f"a:\n  device: 1\n  key: {KEY[:-2]}\n", 3, "32 hexadecimal digits"),
        (f"a:\n  device: 1\n  key: {KEY[:-2]}zz\n", 3, "32 hexadecimal digits"),
        (f"a:\n  device: 0\n  key: {KEY}\n", 2, "device id of 'a'"),
        (f"a:\n  device: 0x100000000\n  key: {KEY}\n", 2, "device id of 'a'"),
        (f"a:\n  device: wrist\n  key: {KEY}\n", 2, "device id of 'a'"),
        (f"a:\n  devise: 1\n  key: {KEY}\n", 2, "unknown field 'devise'"),
        (f"a: {{{KEY}}}\n", 1, "unknown field;"),
        (f"{KEY}: 1\n", 1, "at most 24"),
        (f'"\\e[2Ja": {{device: 1, key: {KEY}}}\n', 1, "no control characters"),
        (f'"\\x9ba": {{device: 1, key: {KEY}}}\n', 1, "no control characters"),
        (f'"\\ud800": {{device: 1, key: {KEY}}}\n', 1, "no control characters"),
        (f'"a\\0": {{device: 1, key: {KEY}}}\n', 1, "no control characters"),
        (f"a: {{device: 1, key: [{KEY}]}}\n", 1, "plain text"),
        ("a:\n  device: 1\n", 2, "has no key"),
        (f"a: {KEY}\n", 1, "needs a device id and a key"),
        ("- a\n- b\n", 1, "one entry a sensor"),
        (f"a: {{device: 1, key: {KEY}\nb: :\n", 2, "not valid YAML"),
        ("a: \x07\n", 1, "not valid YAML"),
        ("[" * 5000, 1, "not valid YAML"),
        ("a" * 70_000, 1, "larger than 64 KiB"),
    ],
)
def test_every_mistake_has_its_line_and_shows_no_key(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    path = tmp_path / "sensors.keys"
    path.write_text(text)
    with pytest.raises(KeyFileError) as caught:
        load_keys(path)
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert message in str(caught.value)
    assert KEY[:12] not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(KeyFileError, match="UTF-8"):
        load_keys(path)


def test_no_representation_holds_the_key(tmp_path: Path) -> None:
    keys = create_keys(tmp_path / "sensors.keys", ["a"])
    assert keys["a"].key.hex() not in repr(keys)
    assert repr(keys["a"].key) not in repr(keys)


def test_a_wrong_name_is_told_the_nearest(tmp_path: Path) -> None:
    keys = create_keys(tmp_path / "sensors.keys", ["left-wrist", "head"])
    assert "Did you mean 'left-wrist'?" in unknown_sensor("left-wirst", keys)
