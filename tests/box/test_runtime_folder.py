"""The runtime folder: this user's alone, and one process a place."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.box.runtime_folder import AlreadyHereError, Claim, RuntimeFolderError, runtime_folder
from appliance.show.box import BoxConfig

HOLDS = (
    "import sys, time\n"
    "from pathlib import Path\n"
    "from appliance.box.runtime_folder import Claim\n"
    "claim = Claim(Path(sys.argv[1]), 'stage')\n"
    "print('held', flush=True)\n"
    "time.sleep(60)\n"
)


def folder_for(environment: dict[str, str]) -> Path:
    return runtime_folder(BoxConfig(), environment)


def test_the_box_file_comes_first_then_systemd_then_the_session(tmp_path: Path) -> None:
    session = tmp_path / "session"
    session.mkdir()
    environment = {"RUNTIME_DIRECTORY": f"{tmp_path}/systemd:/elsewhere", "XDG_RUNTIME_DIR": str(session)}
    assert runtime_folder(BoxConfig(runtime=tmp_path / "named"), environment) == tmp_path / "named"
    assert folder_for(environment) == tmp_path / "systemd"
    del environment["RUNTIME_DIRECTORY"]
    assert folder_for(environment) == session / "bunraku"


def test_without_any_of_them_it_is_in_shared_memory_under_this_users_number() -> None:
    session_that_is_over = {"XDG_RUNTIME_DIR": "/there/is/no/such/folder"}
    made = not (expected := Path(f"/dev/shm/bunraku-{os.getuid()}")).exists()
    try:
        assert folder_for(session_that_is_over) == expected
    finally:
        if made:
            expected.rmdir()


def test_it_is_made_for_this_user_alone_and_found_again(tmp_path: Path) -> None:
    box = BoxConfig(runtime=tmp_path / "deep" / "folder")
    for _ in range(2):
        assert runtime_folder(box).stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mode", [0o750, 0o705, 0o777])
def test_one_that_is_open_to_others_is_refused(tmp_path: Path, mode: int) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(RuntimeFolderError, match=f"mode {mode:o}.*chmod 700 {folder}"):
        runtime_folder(BoxConfig(runtime=folder))


def read_before(runtime: Path) -> BoxConfig:
    """A box file that was read while the runtime's place was still a folder, or free."""
    return BoxConfig().model_copy(update={"runtime": runtime})


def test_a_link_or_a_file_in_its_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "file").touch()
    for name in ("link", "file"):
        with pytest.raises(RuntimeFolderError, match=r"is no folder.*`runtime:` in the box file"):
            runtime_folder(read_before(tmp_path / name))


def test_one_of_somebody_else_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "folder"
    folder.mkdir(mode=0o700)
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    with pytest.raises(RuntimeFolderError, match=r"another user.*`runtime:` in the box file"):
        runtime_folder(BoxConfig(runtime=folder))


def test_one_that_cannot_be_made_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RuntimeFolderError, match=r"cannot be made.*`runtime:` in the box file"):
        runtime_folder(read_before(tmp_path / "file" / "folder"))


def test_a_place_is_taken_once_until_it_is_given_back(tmp_path: Path) -> None:
    first = Claim(tmp_path, "stage")
    with pytest.raises(AlreadyHereError, match=r"Another stage runs in .* `runtime:` in the box file"):
        Claim(tmp_path, "stage")
    Claim(tmp_path, "control").close()
    first.close()
    first.close()
    Claim(tmp_path, "stage").close()


def test_a_process_that_is_killed_gives_its_place_back(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDS, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout is not None and holder.stdout.readline() == "held\n"
            with pytest.raises(AlreadyHereError):
                Claim(tmp_path, "stage")
        finally:
            holder.kill()
    Claim(tmp_path, "stage").close()


def test_a_place_in_a_folder_that_takes_no_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(RuntimeFolderError, match="cannot be opened"):
        Claim(tmp_path / "missing", "stage")
