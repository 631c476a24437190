"""The key file is changed by one writer at a time; comments stay, and no cut leaves half a file."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from appliance.sensor import key_editing
from appliance.sensor.key_editing import editing
from appliance.sensor.keys import KeyFileError, SensorKey, create_keys, fresh_key, load_keys

A, B, C = ("00" * 15 + "0a", "00" * 15 + "0b", "00" * 15 + "0c")
COMMENTED = f"""\
# Ours.

# the red strap
left-wrist: {{device: 0x1, key: {A}}}   # since May
"right wrist":   # block style
  device: 0x2
  key: {B}  # old
# the last one
spare-1:
  {{device: 3,
   key: {C}}}
# the end
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "sensors.keys"
    path.write_text(COMMENTED)
    return path


def test_a_new_sensor_comes_last_and_all_comments_stay(path: Path) -> None:
    with editing(path) as change:
        new = fresh_key("head", change.keys.values())
        change.put(new)
        change.commit()
    text = path.read_text()
    assert text.startswith(COMMENTED)
    assert load_keys(path)["head"] == new
    assert list(load_keys(path)) == ["left-wrist", "right wrist", "spare-1", "head"]


def test_the_first_sensor_makes_the_file_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    with editing(path) as change:
        change.put(SensorKey("head", 5, bytes(16)))
        change.commit()
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.read_text().startswith("# Sensors of this box")
    assert load_keys(path)["head"].device_id == 5


def test_a_replaced_sensor_keeps_its_place_and_comment(path: Path) -> None:
    with editing(path) as change:
        change.put(SensorKey("left-wrist", 9, bytes(16)))
        change.commit()
    text = path.read_text()
    assert f'# the red strap\n"left-wrist": {{device: 0x00000009, key: {"00" * 16}}}   # since May\n' in text
    assert A not in text
    assert load_keys(path)["left-wrist"] == SensorKey("left-wrist", 9, bytes(16))


def test_names_change_hands_and_everything_else_stays(path: Path) -> None:
    before = load_keys(path)
    with editing(path) as change:
        change.swap("left-wrist", "spare-1")
        change.commit()
    after = load_keys(path)
    assert after["left-wrist"].device_id == before["spare-1"].device_id
    assert after["spare-1"].key == before["left-wrist"].key
    assert path.read_text() == COMMENTED.replace("spare-1", "?").replace("left-wrist", '"spare-1"').replace(
        "?", '"left-wrist"'
    )
    with editing(path) as change:
        change.rename("right wrist", "waist")
        change.commit()
    assert '"waist":   # block style\n' in path.read_text()
    assert load_keys(path)["waist"].device_id == 2


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("left-wrist", COMMENTED.replace(f"left-wrist: {{device: 0x1, key: {A}}}   # since May\n", "")),
        (
            "right wrist",
            COMMENTED.replace(f'"right wrist":   # block style\n  device: 0x2\n  key: {B}  # old\n', ""),
        ),
        ("spare-1", COMMENTED.replace(f"spare-1:\n  {{device: 3,\n   key: {C}}}\n", "")),
    ],
)
def test_a_removed_sensor_leaves_nothing_of_its_key(path: Path, name: str, left: str) -> None:
    with editing(path) as change:
        change.remove(name)
        change.commit()
    assert path.read_text() == left
    assert name not in load_keys(path)


def test_the_last_one_can_go(path: Path) -> None:
    with editing(path) as change:
        for name in list(change.keys):
            change.remove(name)
        change.commit()
    assert load_keys(path) == {}
    assert "# the end" in path.read_text()


@pytest.mark.parametrize(
    "text",
    [
        f"{{a: {{device: 1, key: {A}}}, b: {{device: 2, key: {B}}}}}\n",
        f"a: &x {{device: 1, key: {A}}}\nb: {{device: 2, key: {B}}}\n...\n",
        f"? a\n: {{device: 1, key: {A}}}\n? b\n: {{device: 2, key: {B}}}\n",
        f"a: {{device: 1, key: {A}}}\nb: {{device: 2, key: {B}}}",
    ],
)
def test_odd_files_are_understood_too(path: Path, text: str) -> None:
    path.write_text(text)
    with editing(path) as change:
        change.put(SensorKey("c", 3, bytes(16)))
        change.swap("a", "c")
        change.remove("b")
        change.put(SensorKey("a", 4, bytes(16)))
        change.commit()
    assert {name: key.device_id for name, key in load_keys(path).items()} == {"c": 1, "a": 4}


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda change: change.remove("left-wirst"), "Did you mean 'left-wrist'"),
        (lambda change: change.rename("left-wrist", "spare-1"), "already"),
        (lambda change: change.rename("left-wrist", "two words"), "without spaces"),
        (lambda change: change.rename("left-wrist", ""), "1 to 24"),
        (lambda change: change.put(SensorKey("é", 7, bytes(16))), "accents"),
        (lambda change: change.swap("left-wrist", "spare-2"), "there is no sensor 'spare-2'"),
    ],
)
def test_what_cannot_be_done_is_said_and_changes_nothing(path: Path, edit, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(KeyFileError, match=message), editing(path) as change:
        edit(change)
    assert path.read_text() == COMMENTED


def test_without_commit_nothing_changes_and_nothing_is_left(path: Path) -> None:
    with editing(path) as change:
        change.remove("left-wrist")
        change.prepare()
        [beside] = {one.name for one in path.parent.iterdir()} - {path.name}
        assert (path.parent / beside).stat().st_mode & 0o777 == 0o600
    assert path.read_text() == COMMENTED
    assert [one.name for one in path.parent.iterdir()] == [path.name]


def test_a_link_stays_a_link(path: Path) -> None:
    link = path.parent / "link.keys"
    link.symlink_to(path)
    with editing(link) as change:
        change.remove("left-wrist")
        change.commit()
    assert link.is_symlink()
    assert "left-wrist" not in load_keys(path)


def test_a_file_that_is_none_is_refused_and_kept(path: Path) -> None:
    path.write_text("a: [")
    with pytest.raises(KeyFileError, match="not valid YAML"), editing(path):
        pass
    assert path.read_text() == "a: ["


def test_a_second_writer_is_told(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(key_editing, "_PATIENCE_S", 0.1)
    with editing(path), pytest.raises(KeyFileError, match="another bunraku"), editing(path):
        pass
    with editing(path) as change:
        assert len(change.keys) == 3


def add_some(path: Path, word: str) -> None:
    key_editing._PATIENCE_S = 60.0  # the others hold the lock nearly all the time
    for number in range(10):
        with editing(path) as change:
            change.put(fresh_key(f"{word}{number}", change.keys.values()))
            change.commit()


def test_writers_in_several_processes_lose_nothing(path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=add_some, args=(path, word)) for word in "xyz"]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    keys = load_keys(path)
    assert len(keys) == 33
    assert len({key.device_id for key in keys.values()}) == 33


def test_a_full_disk_leaves_the_old_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"), editing(path) as change:
        change.remove("left-wrist")
        change.commit()
    assert path.read_text() == COMMENTED
    assert [one.name for one in path.parent.iterdir()] == [path.name]


def test_an_administrator_does_not_take_the_file_from_the_box(path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give files away")
    os.chown(path, 1234, 2345)
    with editing(path) as change:
        change.remove("left-wrist")
        change.commit()
    assert (path.stat().st_uid, path.stat().st_gid, path.stat().st_mode & 0o777) == (1234, 2345, 0o600)


def test_a_killed_writer_leaves_the_old_file_and_no_lock(path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path\n"
        "from appliance.sensor.key_editing import editing\n"
        "with editing(Path(sys.argv[1])) as change:\n"
        "    change.remove('left-wrist'); change.prepare(); os.kill(os.getpid(), 9)\n"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == -9
    assert path.read_text() == COMMENTED
    with editing(path) as change:
        change.remove("spare-1")
        change.commit()
    assert list(load_keys(path)) == ["left-wrist", "right wrist"]
    assert [one.name for one in path.parent.iterdir()] == [path.name]


names = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=24)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(there=st.lists(names, min_size=2, max_size=5, unique=True), new=names, comment=st.booleans())
def test_any_name_survives_any_change(
    path: Path, monkeypatch: pytest.MonkeyPatch, there: list[str], new: str, comment: bool
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)  # sixty files, on whatever disk this is
    path.unlink(missing_ok=True)
    wanted = create_keys(path, there)
    if comment:
        path.write_text(path.read_text().replace("}\n", "}  # note: {}\n\n"))
    first, second = there[0], there[1]
    with editing(path) as change:
        change.swap(first, second)
        if new not in change.keys:
            change.rename(second, new)
            change.rename(new, second)
        change.remove(first)
        change.put(SensorKey(first, 77, bytes(16)))
        change.commit()
    keys = load_keys(path)
    assert keys[first].device_id == 77
    assert keys[second].key == wanted[first].key
    assert set(keys) == set(there)
    assert path.read_text().count("# note") == (len(there) - 1 if comment else 0)
