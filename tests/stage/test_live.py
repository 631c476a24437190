"""A live dancer on the stage: what the puppet starts from, and the same again from the journal."""

from __future__ import annotations

import contextlib
import math
import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.box.live_pose import LivePose, LivePoseReader, LivePoseWriter
from appliance.levers.sources import LIVE
from appliance.pose import quaternion
from appliance.recorder.journal_reader import read_journal
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show_control.live_input import POSITIONS, ROTATIONS, LiveInput
from appliance.show_control.vmc_input import BONE, ROOT
from appliance.stage import fallback as rows
from appliance.stage.admission import Admission
from appliance.stage.health import Health
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.watch import Watch
from tests.bundles import FIGURE, write_show
from tests.recorder.night import Night
from tests.stage.test_replay import danced

FITS = Admission(3, 2, 3, 2, 64, 0.1, 0.2, 0.3, 10.0)
CUES = [{"name": "guest", "phrase": "live", "fade_s": 0.2}, {"name": "own", "phrase": "main", "fade_s": 0.2}]
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))


@pytest.fixture
def show(tmp_path: Path) -> Path:
    return write_show(tmp_path / "show", hands=[], motion={"live": True}, cues=CUES)


@pytest.fixture
def parts(show: Path) -> Iterator[StageParts]:
    parts = assemble(load_show(show), BOX)
    yield parts
    parts.close()


def pose(angle: float, joints: int = len(FIGURE)) -> bytes:
    """All joints turned by an angle about z."""
    turned = np.tile(quaternion.from_axis_angle([0.0, 0.0, 1.0], angle), (joints, 1))
    return turned.astype(np.float32).tobytes()


class Stream(LivePoseReader):
    """Gives one pose at each read, while it plays."""

    def __init__(self) -> None:
        self.coming: LivePose | None = None

    def read(self) -> LivePose | None:
        coming, self.coming = self.coming, None
        return coming

    def close(self) -> None:
        pass


def angle_of(night: Night) -> float:
    return float(quaternion.angle_between(night.tick.frame.puppets[0].pose[2], quaternion.IDENTITY))


def with_a_guest(night: Night) -> None:
    """A stream that comes, is called, falls silent, comes back and is sent away."""
    stream = night.parts.live_inbox = Stream()

    def dance(ticks: int, angle: float | None) -> None:
        for _ in range(ticks):
            if angle is not None:
                now = night.slot.deadline
                stream.coming = LivePose(now, (0.3, 0.9, now % 1.0), pose(angle))
            night.dance(1)

    dance(40, 0.5)
    night.command("/cue", text="guest")
    dance(60, 0.5)
    assert angle_of(night) == pytest.approx(0.5, abs=1e-3)
    dance(60, None)
    assert angle_of(night) == pytest.approx(0.0, abs=1e-5)  # only the chest of the phrase moves
    dance(40, 0.7)
    assert angle_of(night) == pytest.approx(0.7, abs=1e-3)
    night.command("/cue", text="own")
    dance(400, 0.7)
    assert angle_of(night) == pytest.approx(0.0, abs=1e-5)


def test_a_night_with_a_guest_dances_again_bit_for_bit(show: Path, tmp_path: Path) -> None:
    night = Night(show, tmp_path / "runtime")
    with_a_guest(night)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    assert np.isfinite(run.ticks["live_arrival"]).sum() == 40 + 60 + 40 + 400
    for from_s in (0.0, 11.0):
        replay, comparison = danced(run, show, from_s)
        assert comparison.first is None and comparison.ticks > 50
        assert replay.skipped == 0


def test_a_show_without_a_guest_notes_none(tmp_path: Path) -> None:
    night = Night(write_show(tmp_path / "plain"), tmp_path / "runtime")
    night.dance(5)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    assert run.ticks["live_pose"].nbytes == run.ticks["live_arrival"].nbytes == 0


def test_a_stage_that_starts_again_goes_on_with_its_guest(show: Path, tmp_path: Path) -> None:
    """A checkpoint knows phrases only; what show control declares knows the guest."""
    night = Night(show, tmp_path / "runtime")
    night.command("/phrase", 0.2, text=LIVE)
    assert night.parts.led.source == LIVE
    assert night.parts.led.live is not None
    night.parts.led.live.choose(False, 0.0)
    (order,) = night.reconciler.pending(1.0)
    assert (order.name, order.text) == ("phrase", LIVE)


def test_a_guest_who_falls_silent_is_told_once_and_counted(parts: StageParts) -> None:
    stream, watch = Stream(), Watch(parts, FITS)
    parts.live_inbox = stream
    parts.led.play(LIVE, 0.2)
    for tick in range(200):
        now = tick * 0.02
        stream.coming = LivePose(now, (math.nan,) * 3, pose(0.1)) if tick < 50 or tick > 150 else None
        parts.hear_live()
        parts.led.start(now)
        watch.count_silences(now)
    fallen = {one.name: one for one in watch.fallbacks.happened(4.0)}
    assert fallen[rows.SOURCE_LATE.name].times == 1


@pytest.mark.parametrize("joints", [0, 1, len(FIGURE) + 1])
def test_a_guest_with_another_figure_is_not_believed(parts: StageParts, joints: int) -> None:
    stream = parts.live_inbox = Stream()
    stream.coming = LivePose(1.0, (math.nan,) * 3, pose(0.1, joints))
    assert parts.hear_live() is None
    assert parts.live_refused == 1


def test_poses_that_are_not_believed_are_told(parts: StageParts) -> None:
    stream, watch = Stream(), Watch(parts, FITS)
    parts.live_inbox = stream
    for length in (0.0, math.nan, 1.0, 2.0):
        rotations = (length * np.frombuffer(pose(0.1), np.float32)).tobytes()
        stream.coming = LivePose(1.0, (math.nan,) * 3, rotations)
        parts.hear_live()
    watch.check(4.0, Health())
    fallen = {one.name: one for one in watch.fallbacks.happened(4.0)}
    assert fallen[rows.POSE_REFUSED.name].times == 3 and fallen[rows.POSE_REFUSED.name].active


def test_the_newest_pose_comes_whole_and_once(tmp_path: Path) -> None:
    writer, reader = LivePoseWriter(tmp_path), LivePoseReader(tmp_path)
    assert reader.read() is None
    for arrival in (1.0, 2.0):
        writer.write(arrival, (1.0, 2.0, math.nan), [1.0, 0.0, 0.0, 0.0] * 3)
    heard = reader.read()
    assert heard is not None and heard.arrival == 2.0 and heard.joints == 3
    assert heard.root[:2] == (1.0, 2.0) and math.isnan(heard.root[2])
    assert np.frombuffer(heard.rotations, np.float32).reshape(3, 4)[:, 0].tolist() == [1.0, 1.0, 1.0]
    assert reader.read() is None
    writer.close()
    reader.close()


def test_no_phrase_may_have_the_guests_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'live' is what the stream of motion capture is called"):
        load_show(write_show(tmp_path / "show", motion={"phrases": {LIVE: "phrase.bvh"}}))


def test_a_root_that_jumps_for_a_moment_leaves_the_figure_where_it_was_and_is_told(parts: StageParts) -> None:
    """Places were infinite for ever after."""
    stream, watch = Stream(), Watch(parts, FITS)
    parts.live_inbox, first = stream, parts.led
    first.play(LIVE, 0.2)
    for tick in range(300):
        now = tick * 0.02
        far = 30.0 if 100 <= tick < 105 else 0.0
        stream.coming = LivePose(now, (far, 0.9, 0.0), pose(0.1))
        parts.hear_live()
        first.start(now)
        first.stand()
        first.advance()
        assert np.abs(first.frame.positions).max() < 3.0
    assert first.figures_refused == 0
    watch.check(6.0, Health())
    [jumped] = [one for one in watch.fallbacks.happened(6.0) if one.name == rows.SOURCE_JUMPED.name]
    assert jumped.times == 2


def test_feet_that_do_not_come_keep_the_jumps_of_the_phrase(parts: StageParts) -> None:
    stream = parts.live_inbox = Stream()
    parts.led.play(LIVE, 0.0)
    rotations = np.frombuffer(pose(0.1), np.float32).reshape(-1, 4).copy()
    rotations[[FIGURE.index("lFoot"), FIGURE.index("rFoot")]] = math.nan
    for tick in range(60):
        stream.coming = LivePose(0.02 * tick, (math.nan,) * 3, rotations.tobytes())
        parts.hear_live()
        parts.led.start(0.02 * tick)
    assert parts.led.live is not None and parts.led.live.share == 1.0
    parts.led.motion._stream._tracks[:, 3] = 0.25  # the phrase is in the air
    assert parts.led.lift == pytest.approx(0.25)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e200])
def test_a_figure_that_is_none_never_leaves_and_the_dance_recovers_by_itself(
    show: Path, tmp_path: Path, wrong: float
) -> None:
    night = Night(show, tmp_path / "runtime")
    night.dance(50)
    first, watch = night.parts.led, Watch(night.parts, FITS)
    before = first.frame.positions.copy()
    first.grounding.strayed = wrong, 0.0
    with np.errstate(all="ignore"):
        night.dance(1)
    assert np.array_equal(first.frame.positions, before)
    night.dance(100)
    assert first.figures_refused == 1
    assert np.isfinite(first.frame.positions).all()
    assert np.abs(first.frame.positions - before).max() < 1.0
    watch.check(1.0, Health())
    [refused] = [one for one in watch.fallbacks.happened(1.0) if one.name == rows.FIGURE_REFUSED.name]
    assert (refused.times, refused.active) == (1, True)


BONES = ("Hips", "Chest", "LeftUpperArm", "LeftLowerArm", "LeftFoot", "nobody's")
NUMBERS = (0.0, 0.3, -0.7, 1.0, -1.0, 30.0, -900.0, 1e4, 1e30, -3.5e38, 1e300, float("inf"), float("nan"))
ROTATIONS_OF_BONES = ((0.0, 0.0, 0.0, 1.0), (0.6, 0.0, 0.8, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 1.04, 0.0, 0.0))


def some_message(rng: random.Random) -> tuple[str, list[object]]:
    """One that may be well, or have numbers of any size in some places."""
    address = rng.choice([BONE] * 6 + [ROOT, ROTATIONS, POSITIONS])
    if address in (BONE, ROOT):
        numbers = [rng.choice(NUMBERS[:7]) for _ in range(3)] + [*rng.choice(ROTATIONS_OF_BONES)]
        values: list[object] = [rng.choice(BONES), *numbers]
    else:
        values = [0.5] * ((4 if address == ROTATIONS else 3) * len(FIGURE))
    if rng.random() < 0.2:
        values[rng.randrange(1, len(values))] = rng.choice(NUMBERS)
    return address, values


def test_whatever_a_live_stream_sends_no_frame_is_impossible(tmp_path: Path, rng: random.Random) -> None:
    show = write_show(tmp_path / "show", hands=[], motion={"live": True})
    night = Night(show, tmp_path / "runtime")
    facts = facts_of(night.show, None, night.parts.led.iterations, 0.0)
    first, heard = night.parts.led, 0
    with contextlib.closing(LiveInput(tmp_path / "runtime")) as live:
        night.parts.live_inbox = LivePoseReader(tmp_path / "runtime")
        night.command("/phrase", 0.0, text=LIVE)
        before = first.frame.positions.copy()
        for _ in range(1500):
            for _ in range(4):
                with contextlib.suppress(ValueError):
                    live.hear(*some_message(rng), facts, night.slot.deadline + 0.019)
            night.dance(1)
            heard += night.tick.live_heard is not None
            for numbers in (first.frame.positions, first.frame.pose, first.frame.world, first.frame.root):
                assert np.isfinite(numbers).all()
            assert np.abs(first.frame.positions[0] - before[0]).max() < 2.0  # it is turned upside down
            before = first.frame.positions.copy()
    assert heard > 200
    assert first.figures_refused == 0
