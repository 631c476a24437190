"""The box's memory of its sensors: kept by a thread, private, whole in a power cut, never in the way."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from appliance.sensor.memory import FILE_NAME, IMU_ID_BYTES, LARGEST_FILE, MOST_PROFILES, SensorMemory
from appliance.sensor.neutral import NeutralPose

POSE = NeutralPose((0.5, -0.5, 0.5, 0.5), 0.25, 0xFFFFFFFF)
OTHER = NeutralPose((1.0, 0.0, 0.0, 0.0), -3.0, 7)
IMU, OFFSETS = bytes(range(16)), bytes(range(100, 122))


def silent(words: str) -> None:
    raise AssertionError(words)


def test_what_is_kept_is_there_the_next_night(tmp_path: Path) -> None:
    memory = SensorMemory(tmp_path, silent)
    assert memory.neutral("left-wrist", "lShldr") is None
    assert memory.profiles == {}
    memory.keep_neutral("left-wrist", "lShldr", OTHER)
    memory.keep_neutral("left-wrist", "lShldr", POSE)
    memory.keep_neutral("left-wrist", "odd: joint #1", OTHER)
    memory.keep_profile(IMU, OFFSETS)
    assert memory.neutral("left-wrist", "lShldr") == POSE
    memory.close()
    again = SensorMemory(tmp_path, silent)
    assert again.neutral("left-wrist", "lShldr") == POSE
    assert again.neutral("left-wrist", "odd: joint #1") == OTHER
    assert again.neutral("right-wrist", "lShldr") is None
    assert again.profiles == {IMU: OFFSETS}
    again.close()


def test_the_file_is_its_owners_alone_and_nothing_stays_beside_it(tmp_path: Path) -> None:
    memory = SensorMemory(tmp_path / "state" / "of the box", silent)
    memory.keep_profile(IMU, OFFSETS)
    memory.close()
    [path] = (tmp_path / "state" / "of the box").iterdir()
    assert path.name == FILE_NAME
    assert path.stat().st_mode & 0o777 == 0o600


def test_more_calibrations_than_a_house_has_imus_do_not_fill_the_file(tmp_path: Path) -> None:
    memory = SensorMemory(tmp_path, silent)
    memory.keep_neutral("left-wrist", "lShldr", POSE)
    for number in range(20_000):
        memory.keep_profile(number.to_bytes(IMU_ID_BYTES, "big"), OFFSETS)
    memory.close()
    assert (tmp_path / FILE_NAME).stat().st_size < LARGEST_FILE / 10
    again = SensorMemory(tmp_path, silent)
    assert again.neutral("left-wrist", "lShldr") == POSE
    assert list(again.profiles) == [
        number.to_bytes(IMU_ID_BYTES, "big") for number in range(20_000 - MOST_PROFILES, 20_000)
    ]
    again.close()


def test_nothing_new_writes_nothing(tmp_path: Path) -> None:
    SensorMemory(tmp_path, silent).close()
    assert not (tmp_path / FILE_NAME).exists()


def test_without_a_folder_it_remembers_for_the_run(tmp_path: Path) -> None:
    memory = SensorMemory(None, silent)
    memory.keep_neutral("a", "b", POSE)
    memory.keep_profile(IMU, OFFSETS)
    assert memory.neutral("a", "b") == POSE
    assert memory.profiles == {IMU: OFFSETS}
    memory.close()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "neutral: {",
        "[1, 2]",
        "neutral: {}\n",
        "neutral: {a: {b: {orientation: [2, 0, 0, 0], heading: 0, boot_nonce: 1}}}\nprofiles: {}\n",
        "neutral: {a: {b: {orientation: [.nan, 0, 0, 0], heading: 0, boot_nonce: 1}}}\nprofiles: {}\n",
        "neutral: {a: {b: {orientation: [1, 0, 0, 0], heading: .inf, boot_nonce: 1}}}\nprofiles: {}\n",
        "neutral: {a: {b: {orientation: [1, 0, 0, 0], heading: 0, boot_nonce: -1}}}\nprofiles: {}\n",
        'neutral: {}\nprofiles: {"00": "11"}\n',
        "neutral: {}\nprofiles: {12: 13}\n",
        "[" * 5000,
        "neutral: {a: {b: {orientation: [1, 0, 0, 0], heading: 0, boot_nonce: .inf}}}\nprofiles: {}\n",
        f"neutral: {{a: {{b: {{orientation: [1, 0, 0, 0], heading: 1{'0' * 400}, boot_nonce: 1}}}}}}\n"
        "profiles: {}\n",
        "neutral: &none {}\nprofiles: *none\n",
        "a0: &a0 {b: 1}\n"
        + "".join(f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}\n" for n in range(1, 20)),
    ],
)
def test_a_damaged_file_is_set_aside_and_said_once(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE_NAME).write_text(text)
    said: list[str] = []
    memory = SensorMemory(tmp_path, said.append)
    assert memory.neutral("a", "b") is None
    [words] = said
    assert "damaged" in words
    assert (tmp_path / f"{FILE_NAME}.broken").read_text() == text
    memory.keep_neutral("a", "b", POSE)
    memory.close()
    again = SensorMemory(tmp_path, silent)
    assert again.neutral("a", "b") == POSE
    again.close()


def test_bytes_that_are_no_text_are_set_aside(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"\xff\xfe\x00")
    said: list[str] = []
    SensorMemory(tmp_path, said.append).close()
    assert len(said) == 1


def test_a_disk_that_takes_nothing_is_said_once_and_the_show_goes_on(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where the folder should be")
    said: list[str] = []
    memory = SensorMemory(tmp_path / "state", said.append)
    for number in range(3):
        memory.keep_neutral("a", f"joint {number}", POSE)
        assert memory.neutral("a", f"joint {number}") == POSE
    memory.close()
    assert said
    assert all("`state` in the box file" in words for words in said)
    assert sum("cannot be kept" in words for words in said) == 1


def test_a_write_cut_short_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = SensorMemory(tmp_path, silent)
    memory.keep_neutral("a", "b", POSE)
    memory.close()
    before = (tmp_path / FILE_NAME).read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    said: list[str] = []
    memory = SensorMemory(tmp_path, said.append)
    monkeypatch.setattr(os, "fsync", full)
    memory.keep_neutral("a", "b", OTHER)
    memory.close()
    assert (tmp_path / FILE_NAME).read_bytes() == before
    assert "No space left" in said[0]
    assert [path.name for path in tmp_path.iterdir()] == [FILE_NAME]
