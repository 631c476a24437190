"""The runtime folder is deleted under a running box: it comes back with all that is in force."""

from __future__ import annotations

import os
import shutil
import signal
import time
from pathlib import Path

import pytest

from appliance.box.block import BlockReader, BlockWriter
from appliance.box.orders import Order, OrderInbox, OrderSender
from appliance.box.runtime_folder import AlreadyHereError, Claim, renew_lost, restored_file
from appliance.recorder.journal_reader import read_journal
from tests.bundles import write_show
from tests.console.page import box_with_page
from tests.system.processes import children_running, wait_until


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir(mode=0o700)
    return tmp_path / "run"


def test_everything_of_a_process_is_there_again(folder: Path) -> None:
    block, reader = BlockWriter(folder / "block", "test", 100), BlockReader(folder / "block", "test")
    block.write(b"in force")
    assert reader.read() == b"in force"
    claim, inbox, sender = Claim(folder, "stage"), OrderInbox(folder, "stage"), OrderSender(folder)
    (folder / "chosen.json").write_text("{}")
    number = inbox.fileno()
    with restored_file(folder / "chosen.json"):
        assert renew_lost() is None, "nothing was lost"
        (folder / "chosen.json").write_text("{1}")
        assert renew_lost() is None
        shutil.rmtree(folder)
        assert sender.send("stage", Order("jump", (1.0,))) == "absent"
        assert renew_lost() == ""
        assert renew_lost() is None
        assert folder.stat().st_mode & 0o777 == 0o700
        assert (folder / "chosen.json").read_text() == "{1}"
    fresh = BlockReader(folder / "block", "test")
    assert fresh.read() == b"in force" and fresh.writer_lives()
    block.write(b"and written on")
    assert fresh.read() == reader.read() == b"and written on"
    assert sender.send("stage", Order("jump", (1.0,))) == "sent" and inbox.fileno() == number
    assert inbox.take() == Order("jump", (1.0,))
    with pytest.raises(AlreadyHereError):
        Claim(folder, "stage")
    for one in (block, reader, fresh, claim, inbox, sender):
        one.close()
    shutil.rmtree(folder)
    assert renew_lost() is None, "what was closed is not made again"


def test_what_another_process_has_put_there_is_left_alone(folder: Path) -> None:
    block = BlockWriter(folder / "block", "test", 100)
    (folder / "block").unlink()
    other = BlockWriter(folder / "block", "test", 100)
    other.write(b"of the other one")
    assert renew_lost() is None
    assert BlockReader(folder / "block", "test").read() == b"of the other one"
    block.close()
    other.close()


def test_a_folder_that_cannot_be_made_again_is_told(folder: Path) -> None:
    block = BlockWriter(folder / "block", "test", 100)
    shutil.rmtree(folder)
    folder.write_text("a file")
    assert "cannot be made again" in (renew_lost() or "")
    folder.unlink()
    assert renew_lost() == ""
    block.close()


def test_a_folder_that_is_deleted_comes_back_and_commands_with_it(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", hands=[])
    night = ("--journal", str(tmp_path / "night"))
    with box_with_page(show, tmp_path, *night, has_sensors=False) as (box, page):
        page.unlock()
        wait_until(lambda: page.does("/panic"))
        shutil.rmtree(box.runtime, ignore_errors=True)  # meanwhile it may be there again
        wait_until(lambda: (box.runtime / "frame").exists() and (box.runtime / "control.health").exists())
        wait_until(lambda: "was deleted" in box.output)
        wait_until(lambda: any(one["name"] == "folder-lost" for one in page.status()["fallbacks"]))
        (control,) = children_running(box.process.pid, "appliance.show_control")
        os.kill(control, signal.SIGKILL)
        wait_until(lambda: children_running(box.process.pid, "appliance.show_control") not in ([control], []))
        wait_until(lambda: (page.status().get("status") or {}).get("panic") == 1)
        wait_until(lambda: page.does("/go"))
        wait_until(lambda: page.status()["status"]["state"] == "dancing")
        box.pause()
        time.sleep(0.1)
        assert box.frames(5)
        assert box.end() == 0
    (run,) = read_journal(tmp_path / "night").runs
    ticks, skipped = run.ticks["tick"].astype(int), int(run.ticks["skipped"].sum())
    assert ticks[-1] - ticks[0] + 1 - len(ticks) == skipped, "the journal lost no tick that was danced"
