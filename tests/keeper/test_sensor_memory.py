"""The box's memory of its sensors: in memory at once, on the disk by the keeper, never in the way."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from appliance.box.block import BlockWriter
from appliance.keeper.mirror import RETRY_S, Mirror
from appliance.keeper.records import mirrored_sensor_memory
from appliance.sensor.memory import FILE_NAME, IMU_ID_BYTES, LARGEST, MOST_PROFILES, forget_memory
from appliance.sensor.neutral import NeutralPose
from appliance.stage.sensor_memory import SensorMemory
from tests.logged import said

POSE = NeutralPose((0.5, -0.5, 0.5, 0.5), 0.25, 0xFFFFFFFF)
OTHER = NeutralPose((1.0, 0.0, 0.0, 0.0), -3.0, 7)
IMU, OFFSETS = bytes(range(16)), bytes(range(100, 122))


class Box:
    """A box with its folders: nights at which sensors are learnt, a keeper, the power and its end."""

    def __init__(self, folder: Path) -> None:
        self.runtime, self.state = folder / "runtime", folder / "state"
        self.said = said
        self.power_on()

    def power_on(self) -> None:
        """Memory is empty, and the keeper starts."""
        self.runtime.mkdir(exist_ok=True)
        for path in self.runtime.iterdir():
            path.unlink()
        self.keeper = Mirror(mirrored_sensor_memory(self.runtime, self.state))

    def memory(self) -> SensorMemory:
        """As a stage that starts has it."""
        return SensorMemory(self.state, self.runtime)

    @property
    def on_disk(self) -> SensorMemory:
        """What a start after a power cut knows."""
        return SensorMemory(self.state)


@pytest.fixture
def box(tmp_path: Path) -> Box:
    return Box(tmp_path)


def test_what_is_kept_is_there_the_next_night(box: Box) -> None:
    memory = box.memory()
    assert memory.neutral("left-wrist", "lShldr") is None
    assert memory.profiles == {}
    memory.keep_neutral("left-wrist", {"lShldr": OTHER})
    memory.keep_neutral("left-wrist", {"lShldr": POSE})
    memory.keep_neutral("left-wrist", {"odd: joint #1": OTHER})
    memory.keep_profile(IMU, OFFSETS)
    assert memory.neutral("left-wrist", "lShldr") == POSE
    box.keeper.turn(100.0)
    memory.close()
    box.power_on()
    again = box.memory()
    assert again.neutral("left-wrist", "lShldr") == POSE
    assert again.neutral("left-wrist", "odd: joint #1") == OTHER
    assert again.neutral("right-wrist", "lShldr") is None
    assert again.profiles == {IMU: OFFSETS}
    again.close()


def test_a_stage_that_is_killed_has_lost_nothing_though_no_disk_took_it(box: Box) -> None:
    memory = box.memory()
    memory.keep_neutral("left-wrist", {"lShldr": POSE})
    memory.keep_profile(IMU, OFFSETS)
    memory.close()  # all that the kernel does for a process that is gone
    assert not box.state.exists()
    again = box.memory()
    assert again.neutral("left-wrist", "lShldr") == POSE
    assert again.profiles == {IMU: OFFSETS}
    again.keep_neutral("left-wrist", {"lHand": OTHER})
    box.keeper.turn(100.0)
    assert box.on_disk.neutral("left-wrist", "lShldr") == POSE
    again.close()


def test_a_sensors_joints_are_kept_all_or_none(box: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage that is killed between two of them would ask its dancer to stand still in mid-dance."""
    written: list[bytes] = []
    real = BlockWriter.write
    monkeypatch.setattr(BlockWriter, "write", lambda self, text: (written.append(text), real(self, text))[1])
    memory = box.memory()
    memory.keep_neutral("left-wrist", {"lShldr": POSE, "lHand": POSE})
    assert len(written) == 1
    memory.close()
    again = box.memory()
    assert again.neutral("left-wrist", "lShldr") == again.neutral("left-wrist", "lHand") == POSE
    again.close()


def test_memory_of_another_state_folder_is_not_taken(box: Box, tmp_path: Path) -> None:
    memory = box.memory()
    memory.keep_neutral("left-wrist", {"lShldr": POSE})
    memory.close()
    other = SensorMemory(tmp_path / "other", box.runtime)
    assert other.neutral("left-wrist", "lShldr") is None
    other.keep_neutral("left-wrist", {"lShldr": OTHER})
    box.keeper.turn(100.0)
    assert not box.state.exists()
    other.close()


def test_the_file_is_its_owners_alone_and_nothing_stays_beside_it(box: Box, tmp_path: Path) -> None:
    box.state = tmp_path / "deep" / "state of the box"
    box.power_on()
    memory = box.memory()
    memory.keep_profile(IMU, OFFSETS)
    box.keeper.last_turn(100.0)
    memory.close()
    [path] = box.state.iterdir()
    assert path.name == FILE_NAME
    assert path.stat().st_mode & 0o777 == 0o600


def test_more_calibrations_than_a_house_has_imus_do_not_fill_the_file(box: Box) -> None:
    memory = box.memory()
    memory.keep_neutral("left-wrist", {"lShldr": POSE})
    for number in range(2000):
        memory.keep_profile(number.to_bytes(IMU_ID_BYTES, "big"), OFFSETS)
    box.keeper.turn(100.0)
    memory.close()
    assert (box.state / FILE_NAME).stat().st_size < LARGEST / 10
    again = box.on_disk
    assert again.neutral("left-wrist", "lShldr") == POSE
    assert list(again.profiles) == [
        number.to_bytes(IMU_ID_BYTES, "big") for number in range(2000 - MOST_PROFILES, 2000)
    ]


def test_nothing_new_writes_nothing(box: Box) -> None:
    box.memory().close()
    box.keeper.turn(100.0)
    assert not box.state.exists()
    memory = box.memory()
    memory.keep_neutral("a", {"b": POSE})
    box.keeper.turn(101.0)
    before = (box.state / FILE_NAME).stat()
    for turn in range(3):
        box.keeper.turn(102.0 + turn)
    restarted = Mirror(mirrored_sensor_memory(box.runtime, box.state))
    restarted.last_turn(105.0)  # it finds on the disk what memory has
    assert os.path.samestat((box.state / FILE_NAME).stat(), before)
    memory.close()


def test_a_box_that_ends_leaves_the_disks_word_to_count(box: Box) -> None:
    """A person may then edit or remove the file; but what the disk has not taken stays in memory."""
    memory = box.memory()
    memory.keep_neutral("a", {"b": POSE})
    memory.close()
    forget_memory(box.runtime, box.state)
    assert box.memory().neutral("a", "b") == POSE
    box.keeper.last_turn(100.0)
    forget_memory(box.runtime, box.state)
    (box.state / FILE_NAME).unlink()
    assert box.memory().neutral("a", "b") is None


def test_more_than_a_file_may_hold_is_said_once(box: Box) -> None:
    memory = box.memory()
    for number in range(30):
        memory.keep_neutral("a", {f"{number}" * 10_000: POSE})
        assert memory.neutral("a", f"{number}" * 10_000) == POSE
    assert len(said) == 1 and "cannot be kept" in said[0]
    memory.close()


def test_without_a_folder_it_remembers_for_the_run(tmp_path: Path) -> None:
    memory = SensorMemory(None)
    memory.keep_neutral("a", {"b": POSE})
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
def test_a_damaged_file_is_set_aside_and_said_once(box: Box, text: str) -> None:
    box.state.mkdir()
    (box.state / FILE_NAME).write_text(text)
    memory = box.memory()
    assert memory.neutral("a", "b") is None
    [message] = said
    assert "damaged" in message
    assert (box.state / f"{FILE_NAME}.broken").read_text() == text
    memory.keep_neutral("a", {"b": POSE})
    box.keeper.turn(100.0)
    memory.close()
    assert box.on_disk.neutral("a", "b") == POSE


def test_bytes_that_are_no_text_are_set_aside(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"\xff\xfe\x00")
    SensorMemory(tmp_path).close()
    assert len(said) == 1


def test_a_disk_that_takes_nothing_is_said_once_and_tried_again(box: Box) -> None:
    box.state.write_text("a file where the folder should be")
    memory = box.memory()
    for number in range(3):
        memory.keep_neutral("a", {f"joint {number}": POSE})
        assert memory.neutral("a", f"joint {number}") == POSE
        box.keeper.turn(100.0 + RETRY_S * number)
    assert len(box.said) == 1 and box.keeper.complaint == box.said[0]
    assert "cannot be kept" in box.said[0] and "`state:` in the box file" in box.said[0]
    box.state.unlink()
    box.keeper.turn(200.0)
    assert box.keeper.complaint == "" and "again" in box.said[1]
    assert box.on_disk.neutral("a", "joint 2") == POSE
    memory.close()


def test_a_write_cut_short_leaves_the_old_file(box: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = box.memory()
    memory.keep_neutral("a", {"b": POSE})
    box.keeper.turn(100.0)
    before = (box.state / FILE_NAME).read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    memory.keep_neutral("a", {"b": OTHER})
    box.keeper.turn(101.0)
    assert (box.state / FILE_NAME).read_bytes() == before
    assert "No space left" in box.said[0]
    assert [path.name for path in box.state.iterdir()] == [FILE_NAME]
    memory.close()


def test_a_disk_that_is_mounted_late_gets_it_too(box: Box) -> None:
    memory = box.memory()
    memory.keep_neutral("a", {"b": POSE})
    box.keeper.turn(100.0)
    box.state.rename(box.state.with_name("covered"))
    box.state.mkdir()
    box.keeper.turn(101.0)
    assert box.on_disk.neutral("a", "b") == POSE
    memory.close()


def test_a_runtime_folder_without_room_is_said_once_and_the_show_goes_on(box: Box) -> None:
    box.runtime.rmdir()
    box.runtime.write_text("")
    memory = box.memory()
    memory.keep_neutral("a", {"b": POSE})
    assert memory.neutral("a", "b") == POSE
    assert len(said) == 1 and "`runtime:` in the box file" in said[0]
    memory.close()
