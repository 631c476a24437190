"""Files in the box's folders: no FIFO, device or enormous file blocks or ends it."""

from __future__ import annotations

import json
import math
import os
import resource
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from uuid import UUID

import numpy as np
import pytest

from appliance.box.block import BlockReader, BlockWriter
from appliance.box.checkpoint import Checkpoint, Standing, packed, unpacked
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.dancer.phrase_cache import FOLDER, LARGEST, SUFFIX, PhraseCache, prepare
from appliance.fixture_library.convert import convert_file
from appliance.outputs.dmx.sacn import component_identifier
from appliance.pose.bvh import BvhError, read_bvh, write_bvh
from appliance.projector.alignment import AlignmentFile
from appliance.release.choice import Choice
from appliance.release.trial import chosen_to_dance
from appliance.sensor.keys import KeyFileError, load_keys
from appliance.show.config_error import ConfigError
from appliance.show.projector import ProjectorConfig
from appliance.stage.sensor_memory import SensorMemory
from tests.bundles import FIGURE, swaying_phrase, write_show
from tests.standing import read_checkpoint

PATIENCE_S = 120.0
PEAK = 400 << 20  # bytes: the libraries have half of it
DEEP = b"[" * 100_000


def keys(path: Path) -> None:
    with pytest.raises((KeyFileError, OSError)):
        load_keys(path)


def memory(path: Path) -> None:
    path.rename(path.with_name("sensors.memory"))
    SensorMemory(path.parent)


def alignment(path: Path) -> None:
    saved = AlignmentFile(path.parent, ProjectorConfig())
    path.rename(saved.path)
    saved.close()
    AlignmentFile(path.parent, ProjectorConfig()).close()


def identity(path: Path) -> None:
    path.rename(path.with_name("sacn-cid"))
    assert isinstance(component_identifier(path.parent), UUID)


def fixture(path: Path) -> None:
    with pytest.raises(ConfigError, match=path.name):
        convert_file(path, path.with_suffix(".yaml"))


def choice(path: Path) -> None:
    assert Choice.read(path) is None
    assert chosen_to_dance(path, 0.0).good


def recording(path: Path) -> None:
    with pytest.raises((BvhError, OSError)):
        read_bvh(path)


def checkpoint(path: Path) -> None:
    assert read_checkpoint(path) is None


def fifo(path: Path) -> None:
    os.mkfifo(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def enormous(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)  # sparse


def deep(path: Path) -> None:
    path.write_bytes(DEEP)


@pytest.mark.parametrize("made", [fifo, device, enormous, deep])
@pytest.mark.parametrize("read", [keys, memory, alignment, identity, fixture, choice, recording, checkpoint])
def test_foreign_files_block_and_end_nothing(
    tmp_path: Path, made: Callable[[Path], None], read: Callable[[Path], None]
) -> None:
    made(tmp_path / "found.json")

    def done() -> bytes:
        read(tmp_path / "found.json")
        return str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10).encode()

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
    assert int(run_with_timeout(PATIENCE_S, done)) < max(PEAK, before + (100 << 20))


def test_a_block_with_enormous_slots_or_none_is_refused(tmp_path: Path) -> None:
    """The checksum covers the header alone."""
    path = tmp_path / "block"
    for slots, capacity in ((0, 100), (2, 0xFFFFFFC0), (2, 1 << 30)):
        header = struct.pack("<8s16sIIII", b"bunraku\n", b"test", 1, 1, slots, capacity)
        with path.open("wb") as file:
            file.write(header + struct.pack("<I", zlib.crc32(header)))
            file.seek(128)
            file.write((1).to_bytes(8, "little"))
            file.truncate(1 << 40)

        def read() -> bytes:
            block = BlockReader(path, "test")
            assert block.read() is None
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
            return json.dumps([block.complaint, peak]).encode()

        complaint, peak = json.loads(run_with_timeout(PATIENCE_S, read))
        assert "is damaged" in complaint
        assert peak < max(PEAK, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10) + (100 << 20))


def test_a_block_of_this_box_is_still_read(tmp_path: Path) -> None:
    writer, reader = BlockWriter(tmp_path / "block", "test", 1 << 24), BlockReader(tmp_path / "block", "test")
    writer.write(b"x" * (1 << 24))
    assert reader.read() == b"x" * (1 << 24)


def test_a_checkpoint_with_names_nested_too_deeply_is_refused() -> None:
    payload = packed(Checkpoint("show", (Standing("phrase", 0.0, (0.0, 1.0)),)))
    assert unpacked(payload) is not None
    assert unpacked(payload[: payload.index(b'["show"')] + DEEP) is None


def test_a_recording_that_claims_many_frames_takes_no_memory_for_them(tmp_path: Path) -> None:
    path = tmp_path / "claims.bvh"
    write_bvh(path, swaying_phrase(0.1))
    whole = path.read_text()
    width = len(whole.splitlines()[-1].split())
    path.write_text(whole.replace("Frames: 5", f"Frames: {50_000_000 // width}"))

    def read() -> bytes:
        status = Path("/proc/self/status").read_text().splitlines()
        has = next(int(line.split()[1]) << 10 for line in status if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (has + (100 << 20), has + (100 << 20)))
        return str(len(read_bvh(path))).encode()

    assert run_with_timeout(PATIENCE_S, read) == b"5"


def test_slow_frames_that_last_for_days_are_refused(tmp_path: Path) -> None:
    """Each would become five hundred frames at the stage's rate."""
    path = tmp_path / "slow.bvh"
    write_bvh(path, swaying_phrase(100.0))
    lines = path.read_text().splitlines()
    number = next(number for number, line in enumerate(lines) if line.startswith("Frame Time"))
    lines[number] = "Frame Time: 9"  # seconds: no usual rate, and no milliseconds of one
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(BvhError, match=r"slow.bvh:\d+: more than 4115 frames of 27 values \(37035 s\)"):
        read_bvh(path)


def forged(facts: object, arrays: bytes) -> bytes:
    """A prepared phrase that a bundle may bring."""
    encoded = json.dumps(facts).encode() if not isinstance(facts, bytes) else facts
    encoded = encoded.ljust(-(-(28 + len(encoded)) // 64) * 64 - 28)
    body = encoded + arrays
    return struct.pack("<17sII3x", b"bunraku phrase 1\n", len(encoded), zlib.crc32(body)) + body


@pytest.mark.parametrize(
    "shapes",
    [
        [[5, 8, 4], [5, 3], [2]],
        [[5, 8, 4]],
        [[5, 8], [5, 3]],
        [[5, 8, 4], [4, 3]],
        [[5, 8, 4], [5, 3], [1], [5]],
        [[-1, 8, 4], [5, 3]],
        [[1 << 62, 1 << 62], [5, 3]],
        [[math.inf, 8, 4], [5, 3]],
        [5],
        DEEP,
        None,
    ],
)
def test_a_prepared_phrase_of_something_else_is_read_again(tmp_path: Path, shapes: object) -> None:
    show = write_show(tmp_path / "show")
    prepare([show / "phrase.bvh"], show, FIGURE, grounded=True)
    (saved,) = (show / FOLDER).glob(f"*{SUFFIX}")
    names = {"joints": FIGURE.names, "parents": [int(parent) for parent in FIGURE.parents]}
    facts = shapes if isinstance(shapes, bytes) else names | {"shapes": shapes}
    saved.write_bytes(forged(facts, np.zeros(1000, np.float32).tobytes()))
    found = PhraseCache(show, None).phrase(show / "phrase.bvh", FIGURE, grounded=True)
    assert found is not None and len(found[0]) == 150


@pytest.mark.parametrize("made", [fifo, device, enormous])
def test_a_prepared_phrase_that_is_no_file_is_read_again(
    tmp_path: Path, made: Callable[[Path], None]
) -> None:
    show = write_show(tmp_path / "show")
    prepare([show / "phrase.bvh"], show, FIGURE, grounded=True)
    (saved,) = (show / FOLDER).glob(f"*{SUFFIX}")
    saved.unlink()
    made(saved)

    def read() -> bytes:
        found = PhraseCache(show, None).phrase(show / "phrase.bvh", FIGURE, grounded=True)
        return str(found and len(found[0])).encode()

    assert run_with_timeout(PATIENCE_S, read) == b"150"
    assert LARGEST < 1 << 40
