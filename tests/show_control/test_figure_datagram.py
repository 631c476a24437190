"""Whole figures of SlimeVR-Server (VMC), Xsens MVN and mocopi, in packets made after their sources."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.levers.sources import LIVE
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.possible import FARTHEST_M
from appliance.pose.quaternion import Array
from appliance.pose.t_pose import humanoid_rest
from appliance.show.programs import MOCOPI_BONES
from appliance.show_control.figure_datagram import turns_in
from appliance.show_control.intake import LIVE_WAITING
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts, until
from tests.show_control.fuzz import bundle, message

PHRASE = read_bvh(files("appliance.show").joinpath("martial_show", "phrase.bvh"))
FIGURE = PHRASE.skeleton
UPRIGHT = quaternion.inverse(humanoid_rest(FIGURE))
HIPS = (0.25, 0.9, -0.5)
SIDES = ("left", "right")
PARTS = ("upper arm", "forearm", "hand", "thigh", "shin", "foot")
BODY = ("hips", "chest", "neck", "head", *(f"{side} {part}" for side in SIDES for part in PARTS))

Quaternion = tuple[float, float, float, float]


@pytest.fixture
def reader(folder: Path) -> Iterator[LivePoseReader]:
    show = replace(facts(), skeleton=FIGURE, phrases=("main", LIVE))
    with StageDouble(folder, show), closing(LivePoseReader(folder)) as reader:
        yield reader


def true_turns(frame: int) -> tuple[Array, dict[str, Array]]:
    """World rotations (J, 4) of the dance, and for each part its turn from a T-pose."""
    _, world = FIGURE.forward_kinematics(PHRASE.poses[frame].astype(float), np.zeros(3))
    turns = quaternion.multiply(world, UPRIGHT)
    return world, {part: turns[joint] for part, joint in FIGURE.roles.items()}


def follows(received: Sequence[bytes], asker: Asker, reader: LivePoseReader, world: Array) -> LivePose:
    """Send until the figure has these world rotations, in all parts of the body."""
    joints = [FIGURE.roles[part] for part in BODY]
    found: list[LivePose] = []

    def has_them() -> bool:
        for one in received:
            asker.socket.send(one)
        if (heard := reader.read()) is None:
            return False
        turned = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4).astype(float)
        turned[np.isnan(turned).any(axis=1)] = quaternion.IDENTITY
        _, now = FIGURE.forward_kinematics(turned, np.zeros(3))
        off = np.degrees(quaternion.angle_between(now[joints], world[joints]))
        found.append(heard)
        return bool(off.max() < 0.1)

    until(has_them)
    return found[-1]


def slimevr(turns: dict[str, Array]) -> bytes:
    """One bundle as VMCHandler.kt makes it: time, state, root and 50 bones in Unity's order, the upper chest
    last; each turns against the bone above. The trunk's turn is all in the upper chest.
    """
    none = quaternion.IDENTITY.astype(float)
    upper = turns["chest"]
    chains: list[tuple[str, Array, Array]] = [("Hips", turns["hips"], none)]
    legs = (("UpperLeg", "thigh", ""), ("LowerLeg", "shin", "thigh"), ("Foot", "foot", "shin"))
    arms = (("UpperArm", "upper arm", ""), ("LowerArm", "forearm", "upper arm"), ("Hand", "hand", "forearm"))
    for limbs, start in ((legs, turns["hips"]), (arms, upper)):
        for bone, part, above in limbs:
            for side in SIDES:
                over = turns[f"{side} {above}"] if above else start
                chains.append((f"{side.capitalize()}{bone}", turns[f"{side} {part}"], over))
    chains += [("Spine", turns["hips"], turns["hips"]), ("Chest", turns["hips"], turns["hips"])]
    chains += [("Neck", turns["neck"], upper), ("Head", turns["head"], turns["neck"])]
    chains += [(f"{side.capitalize()}Shoulder", upper, upper) for side in SIDES]
    for side in SIDES:
        for finger in ("Thumb", "Index", "Middle", "Ring", "Little"):
            for part in ("Proximal", "Intermediate", "Distal"):
                chains.append((f"{side.capitalize()}{finger}{part}", none, none))
    chains.append(("UpperChest", upper, turns["hips"]))
    bones = []
    for bone, turn, above in chains:
        w, x, y, z = quaternion.multiply(quaternion.inverse(above), turn).tolist()
        place = (-HIPS[0], HIPS[1], HIPS[2]) if bone == "Hips" else (0.0, 0.1, 0.0)
        bones.append(message("/VMC/Ext/Bone/Pos", bone, *place, -x, y, z, -w))
    assert len(bones) == 50
    root = message("/VMC/Ext/Root/Pos", "root", *[0.0] * 6, -1.0)
    return bundle(message("/VMC/Ext/T", 1.5), message("/VMC/Ext/OK", 1), root, *bones)


def xsens(turns: dict[str, Array], person: int = 0) -> bytes:
    """A datagram of MVN's network streamer, position and orientation as quaternions: 23 segments in the room,
    counted from a T-pose, Z up and X to the front, big-endian.
    """
    arm, leg = ("collar", "upper arm", "forearm", "hand"), ("thigh", "shin", "foot", "toe")
    parts = ["hips", "hips", "spine", "spine", "chest", "neck", "head"]
    parts += [f"{side} {part}" for chain in (arm, leg) for side in ("right", "left") for part in chain]
    segments = b""
    for number, part in enumerate(parts, 1):
        w, x, y, z = turns.get(part, turns[part.replace("toe", "foot")]).tolist()
        segments += struct.pack(">i7f", number, HIPS[2], HIPS[0], HIPS[1], w, z, x, y)
    head = struct.pack(">6sIBBIBBBBHH", b"MXTP02", 7, 0x80, 23, 1234, person, 23, 0, 0, 0, len(segments))
    return head + segments


def chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack("<I4s", len(content), name) + content


def mocopi(turns: dict[str, Array]) -> bytes:
    """A frame of mocopi's UDP: 27 bones, each against the one above, Y up; the trunk turns at its foot."""
    chest = turns["chest"]
    room = {"root": turns["hips"], **{f"torso_{number}": chest for number in range(1, 8)}}
    room |= {"neck_1": turns["neck"], "neck_2": turns["neck"], "head": turns["head"]}
    for letter, side in (("l", "left"), ("r", "right")):
        room[f"{letter}_shoulder"] = chest
        names = ("up_arm", "low_arm", "hand", "up_leg", "low_leg", "foot")
        room |= {f"{letter}_{name}": turns[f"{side} {part}"] for name, part in zip(names, PARTS, strict=True)}
        room[f"{letter}_toes"] = turns[f"{side} foot"]
    above = {"torso_1": "root", "neck_1": "torso_7", "neck_2": "neck_1", "head": "neck_2"}
    above |= {f"torso_{number}": f"torso_{number - 1}" for number in range(2, 8)}
    for letter in "lr":
        above |= {f"{letter}_shoulder": "torso_7", f"{letter}_up_arm": f"{letter}_shoulder"}
        above |= {f"{letter}_low_arm": f"{letter}_up_arm", f"{letter}_hand": f"{letter}_low_arm"}
        above |= {f"{letter}_up_leg": "root", f"{letter}_low_leg": f"{letter}_up_leg"}
        above |= {f"{letter}_foot": f"{letter}_low_leg", f"{letter}_toes": f"{letter}_foot"}
    bones = b""
    for number, name in enumerate(MOCOPI_BONES):
        over = room[above[name]] if name in above else quaternion.IDENTITY.astype(float)
        w, x, y, z = quaternion.multiply(quaternion.inverse(over), room[name]).tolist()
        place = HIPS if name == "root" else (0.0, 0.0, 0.0)
        tran = chunk(b"tran", struct.pack("<7f", x, y, z, w, *place))
        bones += chunk(b"btdt", chunk(b"bnid", struct.pack("<H", number)) + tran)
    head = chunk(b"ftyp", b"sony motion format") + chunk(b"vrsn", b"\x01")
    frame = chunk(b"fnum", bytes(4)) + chunk(b"time", bytes(4)) + chunk(b"btrs", bones)
    return chunk(b"head", head) + chunk(b"sndf", chunk(b"ipad", bytes(8))) + chunk(b"fram", frame)


@pytest.mark.parametrize("program", [slimevr, xsens, mocopi])
def test_the_dance_of_a_program_is_the_figures(
    reader: LivePoseReader, control: ControlInThread, asker: Asker, program, rng: random.Random
) -> None:
    asker.ask("/ping")
    for frame in rng.sample(range(len(PHRASE.poses)), 3):
        world, turns = true_turns(frame)
        heard = follows([program(turns)], asker, reader, world)
        assert heard.root == pytest.approx(HIPS, abs=1e-5)
    live = asker.status().live
    assert "bones" in live and asker.ask("/ping") == ["/pong"]
    assert not [
        one for one in asker.ask_all("/fallbacks") if one[1] in ("live-refused", "live-partial") and one[4]
    ]


def test_slimevrs_bundle_is_as_large_as_its_own() -> None:
    """4,220 bytes for 50 bones: all of it is one datagram."""
    assert len(slimevr(true_turns(0)[1])) > 4096


@pytest.mark.parametrize(
    ("received", "message"),
    [
        (xsens(true_turns(0)[1])[:-1], "no whole datagram of Xsens MVN"),
        (b"MXTP02", "no whole datagram of Xsens MVN"),
        (xsens({part: 3.0 * turn for part, turn in true_turns(0)[1].items()}), "length 1"),
        (xsens({part: np.nan * turn for part, turn in true_turns(0)[1].items()}), "length 1"),
        (mocopi(true_turns(0)[1])[:-1], "no datagram of mocopi"),
        (mocopi({part: 0.0 * turn for part, turn in true_turns(0)[1].items()}), "length 1"),
    ],
)
def test_a_damaged_datagram_is_refused_in_words(
    reader: LivePoseReader, control: ControlInThread, asker: Asker, received: bytes, message: str
) -> None:
    asker.ask("/ping")
    asker.socket.send(received)
    reply = asker.hear()
    assert reply is not None and reply[2] == 0 and message in reply[3]
    assert reader.read() is None
    reported = [one for one in asker.ask_all("/fallbacks") if one[1] == "live-refused"]
    assert reported and reported[0][4] == 1


@pytest.mark.parametrize("program", [xsens, mocopi])
def test_whatever_bytes_come_there_is_a_figure_or_a_sentence(program, rng: random.Random) -> None:
    whole = program(true_turns(0)[1])
    for _ in range(2000):
        received = bytearray(whole[: rng.choice((len(whole), rng.randrange(8, len(whole))))])
        for place in rng.sample(range(8, len(received)), min(rng.randrange(8), len(received) - 8)):
            received[place] = rng.randrange(256)
        try:
            figure = turns_in(bytes(received))
        except ValueError:
            continue
        if figure is not None:
            turns, hips = np.array(list(figure.turns.values())), np.array(figure.hips)
            assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)
            assert np.isnan(hips).all() or np.abs(hips).max() <= FARTHEST_M


def test_other_persons_and_other_datagrams_of_mvn_are_passed_over(
    reader: LivePoseReader, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    asker.socket.send(xsens(true_turns(0)[1], person=1))
    asker.socket.send(b"MXTP12" + bytes(40))
    assert asker.ask("/ping") == ["/pong"]
    assert reader.read() is None


def test_a_flood_of_figures_keeps_no_command_waiting(
    reader: LivePoseReader, control: ControlInThread, asker: Asker
) -> None:
    """They wait as a live dancer's do, not as commands: none of these gives way."""
    asker.ask("/ping")
    received = xsens(true_turns(0)[1])
    with closing(Asker(control.port)) as program:
        for _ in range(LIVE_WAITING + 100):
            program.socket.send(received)
        assert asker.ask("/ping") == ["/pong"]
    assert "commands-dropped" not in [one[1] for one in asker.ask_all("/fallbacks")[:-1] if one[4]]
