"""Journals from who knows where: whatever is in them, they are read or refused in words, and nothing else."""

from __future__ import annotations

import io
import os
import tarfile
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from appliance.box.snapshot import packed, unpacked
from appliance.cli.app import main
from appliance.cli.replay import replay as replay_journal
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.recorder import chunks, log
from appliance.recorder.environment import fingerprints
from appliance.recorder.export import export
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import last_saved, read_journal
from appliance.recorder.record import EVENT, TICK
from appliance.recorder.segments import segment_paths
from appliance.show.show import load_show
from appliance.stage.comparison import Comparison
from appliance.stage.replay import Replay
from tests.bundles import write_show
from tests.recorder.night import Night
from tests.recorder.odd_journals import (
    PATIENCE_S,
    changed_order,
    header,
    listed_in_bounds,
    many_ticks,
    odd_headers,
    with_header,
)


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("bundle") / "show")


@pytest.fixture(scope="module")
def whole(show: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A segment as a box writes it."""
    folder = tmp_path_factory.mktemp("night")
    night = Night(show, folder / "runtime")
    night.dance(20)
    night.order("rate", 0.5)
    night.dance(5)
    (segment,) = segment_paths(night.saved(folder / "journal"))
    return segment.read_bytes()


def all_that_reads(path: Path, folder: Path) -> None:
    """Every command that takes a journal; JournalError alone may come out of it."""
    recording = read_journal(path)
    assert recording.skeleton and recording.ticks is not None
    export(path, folder / "again.bunraku")
    with pytest.raises(SystemExit) as ended:
        main(("journal", "list", "--journal", str(path), "--events"))
    assert ended.value.code == 0


def test_facts_of_something_else_are_refused_in_words(
    whole: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, refused = tmp_path / "odd.segment", 0
    for facts in odd_headers(whole):
        path.write_bytes(with_header(whole, facts))
        try:
            all_that_reads(path, tmp_path)
        except JournalError:
            refused += 1
        last_saved(tmp_path, "another run")  # a keeper that finds it in its folder
    assert refused > 50
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    "entry",
    [
        log.Entry(1, TICK, b"short"),
        log.Entry(1, EVENT, b"no json"),
        log.Entry(1, EVENT, b"[]"),
        log.Entry(1, EVENT, b"{}"),
        log.Entry(1, EVENT, b'{"kind": "order", "now": 1, "order": []}'),
        log.Entry(1, EVENT, b"[" * 100_000),
    ],
)
def test_entries_of_something_else_are_refused_in_words(
    whole: bytes, tmp_path: Path, entry: log.Entry
) -> None:
    path = tmp_path / "odd.segment"
    path.write_bytes(whole + chunks.chunk(chunks.LOG, log.packed([entry]), 1))
    with pytest.raises(JournalError, match=r"damaged|no ticks of Bunraku"):
        read_journal(path)
    path.write_bytes(whole + chunks.chunk(chunks.LOG, b"\xff" * 10_000, 1))
    assert len(read_journal(path).ticks) == 25  # kinds that are not known are left out


def test_a_chunk_unpacks_to_what_it_says_and_to_no_more(whole: bytes, tmp_path: Path) -> None:
    """A kilobyte may stand for a megabyte of zeros, and that for more than any memory holds."""
    bomb = chunks.chunk(chunks.LOG, bytes(1 << 22), 1)
    said_small = bytearray(bomb)
    said_small[16:20] = (100).to_bytes(4, "little")  # where its head has the bytes unpacked
    said_small[20:24] = zlib.crc32(said_small[24:], zlib.crc32(said_small[:20])).to_bytes(4, "little")
    assert [one.kind for one in chunks.chunks(bytes(said_small))] == []
    no_zlib = bytearray(bomb)
    no_zlib[24:] = b"x" * (len(bomb) - 24)
    no_zlib[20:24] = zlib.crc32(no_zlib[24:], zlib.crc32(no_zlib[:20])).to_bytes(4, "little")
    (tmp_path / "odd.segment").write_bytes(whole + bytes(no_zlib))
    assert len(read_journal(tmp_path / "odd.segment").ticks) == 25


def test_names_in_an_archive_lead_nowhere(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    with tarfile.open(path, "w:", format=tarfile.PAX_FORMAT) as archive:
        for name in ("../../../1.segment", "/etc/2.segment", "a" * 90 + "/" + "3" * 190 + ".segment"):
            member = tarfile.TarInfo(name)
            member.size = len(whole)
            archive.addfile(member, io.BytesIO(whole))
        link = tarfile.TarInfo("4.segment")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
    again = export(path, tmp_path / "again.bunraku")
    with tarfile.open(again) as archive:
        assert archive.getnames() == [
            "00000001.segment",
            "00000002.segment",
            "00000003.segment",
            "SHA256SUMS",
        ]


def test_a_small_file_of_very_many_ticks_is_refused(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.segment"
    path.write_bytes(many_ticks(whole, 2_000_000))
    assert path.stat().st_size < 60_000_000
    assert "unpacks to more than" in listed_in_bounds(path)
    path.write_bytes(many_ticks(whole, 90_000))  # half an hour is read
    assert listed_in_bounds(path) == "listed"


@pytest.mark.parametrize("kind", [TICK, EVENT])
def test_a_small_file_of_very_many_entries_is_refused(whole: bytes, tmp_path: Path, kind: int) -> None:
    path = tmp_path / "odd.segment"
    rows = np.zeros(2_000_000, [("number", "<u8"), ("kind", "<u4"), ("bytes", "<u4")])
    rows["number"], rows["kind"] = np.arange(len(rows)), kind
    facts, *_ = chunks.chunks(whole)
    entries = chunks.chunk(chunks.LOG, rows.tobytes(), 1)
    path.write_bytes(chunks.chunk(chunks.HEADER, facts.data) + entries * 4)
    assert "damaged" in listed_in_bounds(path) or "unpacks to more than" in listed_in_bounds(path)


def test_a_small_file_of_enormous_events_is_refused(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.segment"
    event = b'{"kind": "said", "now": 1, "order": {"values": [' + b"[]," * 1_000_000 + b"0]}}"
    entries = [chunks.chunk(chunks.LOG, log.packed([log.Entry(n, EVENT, event)])) for n in range(26, 60)]
    path.write_bytes(whole + b"".join(entries))
    assert "unpacks to more than" in listed_in_bounds(path)


def test_headers_that_stand_for_gigabytes_are_refused(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.segment"
    path.write_bytes(with_header(whole, header(whole) | {"more": [[]] * 10_000_000}))
    assert "nothing was recorded" in listed_in_bounds(path)
    path = tmp_path / "odd.bunraku"
    with tarfile.open(path, "w:") as archive:
        for number in range(100):
            member = tarfile.TarInfo(f"{number}.segment")
            data = with_header(whole, header(whole) | {"run": str(number), "more": [[]] * 200_000})
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    assert "unpacks to more than" in listed_in_bounds(path)


@pytest.mark.parametrize("place", ["odd.segment", "folder/00000001.segment"])
def test_a_fifo_or_a_device_holds_nothing_up(whole: bytes, tmp_path: Path, place: str) -> None:
    path = tmp_path / place
    path.parent.mkdir(exist_ok=True)
    journal = path if path.parent == tmp_path else path.parent
    for make in (os.mkfifo, lambda path: path.symlink_to("/dev/zero")):
        make(path)
        assert "no regular file" in listed_in_bounds(journal) or "no journal is" in listed_in_bounds(journal)
        run_with_timeout(PATIENCE_S, lambda: str(last_saved(path.parent, "another run")).encode())
        path.unlink()


def test_a_keeper_passes_by_what_is_no_segment(show: Path, tmp_path: Path) -> None:
    folder = tmp_path / "journal"
    folder.mkdir()
    os.mkfifo(folder / "00000007.segment")

    def saved() -> bytes:
        night = Night(show, tmp_path / "runtime")
        night.dance(20)
        return str(len(read_journal(night.saved(folder)).ticks)).encode()

    assert run_with_timeout(PATIENCE_S, saved) == b"20"


def test_a_segment_that_goes_while_it_is_exported_is_no_fault(
    show: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A box that dances lets its oldest minute go, however long a slow stick takes."""
    night, folder = Night(show, tmp_path / "runtime"), tmp_path / "journal"
    for _ in range(3):
        night.dance(20)
        night.saved(folder)
    oldest, *_ = segment_paths(folder)
    exported = export(
        folder, tmp_path / "night.bunraku", progress=lambda written, of: oldest.unlink(missing_ok=True)
    )
    assert len(read_journal(exported).ticks) == 60
    assert len(read_journal(export(folder, tmp_path / "later.bunraku")).ticks) == 40


def test_what_is_no_file_has_no_fingerprint(tmp_path: Path) -> None:
    """Names in a journal may lead to a device that never ends."""
    assert fingerprints(tmp_path, ["../../../../../../../dev/zero"]) == {"../../../../../../../dev/zero": ""}


@pytest.mark.parametrize(
    "state",
    [b"", b"\x02\x00\x00\x00{}", b"\xff\xff\xff\xff", b"\x0f\x00\x00\x00" + b'{"motion": 17}'],
)
def test_a_keyframe_of_another_release_is_refused_in_words(
    whole: bytes, show: Path, tmp_path: Path, state: bytes
) -> None:
    path = tmp_path / "odd.segment"
    facts, _, entries = chunks.chunks(whole)
    odd = chunks.chunk(chunks.KEYFRAME, log.POSITION.pack(0) + state)
    path.write_bytes(
        b"".join([chunks.chunk(chunks.HEADER, facts.data), odd, chunks.chunk(chunks.LOG, entries.data, 25)])
    )
    (run,) = read_journal(path).runs
    with pytest.raises(JournalError, match="another release"):
        list(Replay(run, load_show(show)).dance(Comparison(0.0, 0.0)))


@pytest.mark.parametrize("odd", [None, "late", [], {"a": 1}])
def test_a_keyframe_with_a_value_that_nobody_looks_at_before_the_first_tick_is_refused_in_words(
    whole: bytes, show: Path, tmp_path: Path, odd: object
) -> None:
    """A text as the latest start of a tick ended a replay in a traceback."""
    path, (facts, keyframe, entries) = tmp_path / "odd.segment", chunks.chunks(whole)
    state = unpacked(keyframe.data[log.POSITION.size :])
    changes = [state | {name: odd} for name in state]
    changes += [state | {"parts": state["parts"] | {name: odd}} for name in state["parts"]]
    for changed in changes:
        odd_keyframe = chunks.chunk(chunks.KEYFRAME, log.POSITION.pack(0) + packed(changed))
        header, log_ = (chunks.chunk(one.kind, one.data, one.ticks) for one in (facts, entries))
        path.write_bytes(header + odd_keyframe + log_)
        (run,) = read_journal(path).runs
        replay = Replay(run, load_show(show))
        is_refused = changed["latest_start_s"] == odd or changed["parts"] == odd
        refused = pytest.raises(JournalError, match="another release")
        with refused if is_refused else suppress(JournalError):
            list(replay.dance(Comparison(0.0, 0.0)))
        replay.tick.parts.close()


def test_an_order_of_another_release_is_refused_in_words(whole: bytes, show: Path, tmp_path: Path) -> None:
    path = tmp_path / "odd.segment"
    path.write_bytes(changed_order(whole, lambda event: event.pop("order")))
    with pytest.raises(JournalError, match="another release"):
        replay_journal(path, show, 0.0, None)


def test_nothing_in_a_journal_steers_the_terminal(
    whole: bytes, show: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "odd.segment"
    steering = with_header(whole, header(whole) | {"show": "\x1b]0;taken\x07", "cpu": "\x1b[2J"})
    path.write_bytes(changed_order(steering, lambda event: event.update(message="\x1b[2J\n\r")))
    all_that_reads(path, tmp_path)
    assert replay_journal(path, show, 0.0, None) == 0
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err and "\r" not in said.out


def test_an_archive_of_very_many_parts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    path.write_bytes(b"".join(tarfile.TarInfo(f"{n}.segment").tobuf() for n in range(25_000)) + bytes(1024))
    assert "larger than any journal" in listed_in_bounds(path)


def test_an_archive_whose_names_are_enormous_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    name = tarfile.TarInfo("././@LongLink")
    name.type, name.size = tarfile.GNUTYPE_LONGNAME, 1 << 36
    path.write_bytes(name.tobuf(tarfile.GNU_FORMAT))
    with path.open("r+b") as file:
        file.truncate(1 << 37)
    assert "larger than any journal" in listed_in_bounds(path)


def test_a_part_that_claims_to_be_enormous_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    member = tarfile.TarInfo("1.segment")
    member.size = 1 << 40
    path.write_bytes(member.tobuf() + bytes(10240))
    with path.open("r+b") as file:
        file.truncate((1 << 40) + 10240)  # as long as it claims, and no room taken
    with pytest.raises(JournalError, match="larger than any journal"):
        read_journal(path)
