"""The alignment survives a power cut: kept as a whole or not at all, and never a reason to show nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from appliance.projector.alignment import Alignment, AlignmentFile, alignment_folder, file_name
from appliance.show.box import BoxConfig, load_box
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig
from tests.box import disks
from tests.logged import said

FILE_NAME = "projector.alignment"
PINNED = Alignment(((0.1, 0.05), (0.9, 0.1), (1.0, 1.0), (1 / 3, 0.9)), True, 0.8)


def opened(folder: Path, **config: object) -> AlignmentFile:
    return AlignmentFile(folder, ProjectorConfig(**config))  # type: ignore[arg-type]


def keep(folder: Path, alignment: Alignment) -> None:
    file = opened(folder)
    file.keep(alignment)
    file.close()


def test_it_is_the_same_after_a_restart(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    keep(folder, PINNED)
    assert opened(folder).alignment == PINNED
    assert yaml.safe_load((folder / FILE_NAME).read_text())["corners"][0] == [0.1, 0.05]
    assert [path.name for path in folder.iterdir()] == [FILE_NAME] and not said


def test_without_a_change_no_file_is_written(tmp_path: Path) -> None:
    file = opened(tmp_path, mirror=True, brightness=0.5)
    assert file.alignment == Alignment(mirror=True, brightness=0.5)
    file.close()
    assert not list(tmp_path.iterdir())


def test_what_the_box_file_newly_says_goes_over_what_was_chosen_before(tmp_path: Path) -> None:
    keep(tmp_path, PINNED)
    found = opened(tmp_path, brightness=1.5).alignment
    assert found == Alignment(PINNED.corners, True, 1.5)


def test_it_tells_what_goes_over_the_box_file(tmp_path: Path) -> None:
    assert not opened(tmp_path, mirror=True, brightness=0.5).overrides()
    keep(tmp_path, PINNED)
    corners, mirror, brightness = opened(tmp_path).overrides()
    assert "corners" in corners and "is mirrored" in mirror
    assert "is 0.8," in brightness and "box file's 1." in brightness
    assert len(opened(tmp_path, brightness=1.5).overrides()) == 2


@pytest.mark.parametrize(
    "text",
    [
        "",
        "corners: [",
        "corners: 3\n",
        "[1, 2]",
        "corners: [[0, 0], [1, 0], [1, 1]]\nmirror: {chosen: false, box_file: false}\n",
        "corners: [[0, 0], [1, 1], [1, 0], [0, 1]]\nmirror: {chosen: false, box_file: false}\n"
        "brightness: {chosen: 1.0, box_file: 1.0}\n",
        "corners: [[0, 0], [1, 0], [1, 1], [0, 1]]\nmirror: {chosen: false, box_file: false}\n"
        "brightness: {chosen: 100.0, box_file: 1.0}\n",
        "x" * 5000,
    ],
)
def test_a_damaged_file_is_set_aside(tmp_path: Path, text: str) -> None:
    path = tmp_path / FILE_NAME
    path.write_text(text)
    assert opened(tmp_path).alignment == Alignment()
    (sentence,) = said
    assert "damaged" in sentence and "key c" in sentence
    assert not path.exists() and path.with_name(FILE_NAME + ".broken").read_text() == text


def test_bytes_that_are_not_text(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"\xff\xfe\x00")
    assert opened(tmp_path).alignment == Alignment()
    assert len(said) == 1


def test_a_folder_that_cannot_be_written_is_reported_once_and_the_alignment_holds(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    file = opened(tmp_path / "file")
    file.keep(PINNED)
    file.close()
    (sentence,) = said
    assert "cannot be kept" in sentence and file.alignment == PINNED


def test_where_it_is_kept(tmp_path: Path) -> None:
    own = BoxConfig(state=tmp_path / "state")
    assert alignment_folder(own) == tmp_path / "state"
    (tmp_path / "box.yaml").write_text("")
    assert alignment_folder(load_box(tmp_path / "box.yaml")) == tmp_path
    assert alignment_folder(BoxConfig(), {"XDG_STATE_HOME": "/kept"}) == Path("/kept/bunraku")
    assert alignment_folder(BoxConfig(), {}) == Path.home() / ".local" / "state" / "bunraku"


def test_two_projectors_of_one_box_have_a_file_each() -> None:
    names = {file_name(ProjectorConfig(edge_blend=EdgeBlendConfig(part=part))) for part in ("left", "right")}
    assert names | {file_name(ProjectorConfig())} == {
        "projector.alignment",
        "projector-left.alignment",
        "projector-right.alignment",
    }


def test_a_disk_that_hangs_holds_up_neither_the_picture_nor_the_end(tmp_path: Path) -> None:
    if reason := disks.why_not():
        pytest.skip(reason)
    with disks.disk(disks.made_image(tmp_path / "image"), tmp_path / "disk") as disk:
        keep(disk, Alignment(brightness=0.5))
        file = opened(disk)
        with disks.frozen(disk):
            file.keep(PINNED)
            file.close()
            assert "the disk does not answer" in said[-1]
        file.close()
        assert opened(disk).alignment == PINNED
