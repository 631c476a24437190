"""What programs send, against rotations that are known in each program's axes."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

import pytest

from appliance.pose.turns import multiplied
from appliance.sensor.foreign.mocopi import mocopi_messages
from appliance.sensor.foreign.orientations import (
    CONVENTIONS,
    from_device_angles,
    read_orientation,
)
from appliance.sensor.foreign.sources import SourceSettings
from appliance.sensor.neutral import facing_heading
from appliance.sensor.state import Orientation
from appliance.show.programs import MOCOPI_BONES, PROGRAMS

H = math.sqrt(0.5)
ARROW = (1.0, 0.0, 0.0)


def heading_deg(orientation: Orientation) -> float:
    """Where the sensor's arrow points, degrees to the left of the front."""
    heading = facing_heading(orientation, ARROW)
    assert heading is not None
    return math.degrees(heading)


@pytest.mark.parametrize(
    ("axes", "to_the_left", "forward"),
    [
        ("z-up", (H, 0.0, 0.0, H), (H, 0.0, H, 0.0)),  # about z; about y
        ("y-up", (H, 0.0, H, 0.0), (H, H, 0.0, 0.0)),  # about y; about x
        ("unity", (H, 0.0, -H, 0.0), (H, H, 0.0, 0.0)),  # left-handed: to the left is negative about y
    ],
)
def test_each_convention_turns_and_tilts_the_same_way(
    axes: str, to_the_left: Orientation, forward: Orientation
) -> None:
    convention = CONVENTIONS[axes]
    assert convention.to_sensor(to_the_left) == pytest.approx((H, 0.0, 0.0, H))
    assert convention.to_sensor(forward) == pytest.approx((H, 0.0, H, 0.0))
    assert convention.direction(convention.front) == ARROW


@pytest.mark.parametrize("facing", ["x", "-x", "y", "-y", "z", "-z"])
def test_the_axis_that_faces_the_front_is_the_sensors_arrow(facing: str) -> None:
    source = SourceSettings("arm", "osc", "/q", "wxyz", "z-up", facing).source()
    pointing = {"x": 0.0, "-x": 180.0, "y": 90.0, "-y": -90.0}
    heard = source.hear([("/q", [1.0, 0.0, 0.0, 0.0])], 0.0)
    assert heard is not None
    if facing in pointing:
        assert abs(math.remainder(heading_deg(heard) - pointing[facing], 360.0)) < 1e-6
    else:
        assert facing_heading(heard, ARROW) is None


@pytest.mark.parametrize(
    ("values", "numbers"),
    [
        ("wxyz", (H, 0.0, 0.0, H)),
        ("xyzw", (0.0, 0.0, H, H)),
        ("euler", (0.0, 0.0, 90.0)),
        ("matrix", (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
    ],
)
def test_one_turn_in_all_forms(values: str, numbers: Sequence[float]) -> None:
    source = SourceSettings("arm", "osc", "/imu/*", values).source()
    heard = source.hear([("/other", numbers), ("/imu/7", numbers)], 0.0)
    assert heard is not None
    assert heading_deg(heard) == pytest.approx(90.0)


@pytest.mark.parametrize("numbers", [(1.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (2.0, 0.0, 0.0, 0.0), ("x",) * 4])
def test_what_is_no_rotation_is_refused_in_a_sentence(numbers: Sequence[object]) -> None:
    source = SourceSettings("arm", "osc", "/q", "wxyz").source()
    with pytest.raises(ValueError, match=r"/q: .*\."):
        source.hear([("/q", numbers)], 0.0)


def test_a_matrix_of_any_turn_comes_back_as_its_quaternion() -> None:
    for turn in ((0.5, 0.5, 0.5, 0.5), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.1, -0.7, 0.7, 0.1)):
        length = math.hypot(*turn)
        w, x, y, z = (part / length for part in turn)
        matrix = (
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        found = read_orientation("matrix", matrix)
        assert abs(sum(a * b for a, b in zip(found, (w, x, y, z), strict=True))) == pytest.approx(1.0)


def test_a_browsers_angles_turn_about_z_then_x_then_y() -> None:
    assert heading_deg(from_device_angles(90.0, 0.0, 0.0)) == pytest.approx(90.0)
    about_x, about_y = (H, H, 0.0, 0.0), (H, 0.0, H, 0.0)
    assert from_device_angles(0.0, 90.0, 90.0) == pytest.approx(multiplied(about_x, about_y))


def bone(name: str, w: float, x: float, y: float, z: float, kind: str = "Bone") -> tuple[str, list[object]]:
    """A message of VMC: rotations are x, y, z, w."""
    return f"/VMC/Ext/{kind}/Pos", [name, 0.0, 1.0, 0.0, x, y, z, w]


LEFT_45 = (math.cos(math.pi / 8), 0.0, -math.sin(math.pi / 8), 0.0)  # about Unity's y


def test_a_bone_turns_with_the_bones_above_it() -> None:
    source = SourceSettings("arm", "vmc", bone="leftUpperArm").source()
    frame = [bone("Hips", *LEFT_45), bone("RightUpperArm", *LEFT_45), bone("LeftUpperArm", *LEFT_45)]
    heard = source.hear(frame, 0.0)
    assert heard is not None
    assert heading_deg(heard) == pytest.approx(90.0)
    alone = source.hear(frame[2:], 5.0)  # the hips have not come for long
    assert alone is not None
    assert heading_deg(alone) == pytest.approx(45.0)
    assert source.hear(frame[:2], 6.0) is None


@pytest.mark.parametrize("address", ["/VMC/Ext/Root/Pos", "/VMC/Ext/Bone/Pos"])
def test_a_message_of_vmc_without_arguments_is_refused_or_passed_over(address: str) -> None:
    """The root's raised an IndexError, which ended show control."""
    source = SourceSettings("hand", "vmc", bone="LeftLowerArm").source()
    if address.endswith("Bone/Pos"):
        assert source.hear([(address, [])], 0.0) is None
        return
    with pytest.raises(ValueError, match=address):
        source.hear([(address, [])], 0.0)


def test_a_tracker_has_its_orientation_in_the_room() -> None:
    source = SourceSettings("arm", "slimevr", bone="human://LEFT_HAND").source()
    frame = [bone("Hips", *LEFT_45), bone("human://LEFT_HAND", *LEFT_45, kind="Tra")]
    heard = source.hear(frame, 0.0)
    assert heard is not None
    assert heading_deg(heard) == pytest.approx(45.0)


def chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack("<I4s", len(content), name) + content


def mocopi_frame(turns: dict[str, Orientation]) -> bytes:
    """A frame of mocopi's datagrams: the bones by number, each with rotation and position."""
    bones = b"".join(
        chunk(
            b"btdt",
            chunk(b"bnid", struct.pack("<H", MOCOPI_BONES.index(name)))
            + chunk(b"tran", struct.pack("<7f", x, y, z, w, 0.0, 1.0, 0.0)),
        )
        for name, (w, x, y, z) in turns.items()
    )
    head = chunk(b"head", chunk(b"ftyp", b"sony motion format") + chunk(b"vrsn", b"\x01"))
    frame = (
        chunk(b"fnum", struct.pack("<I", 7)) + chunk(b"time", struct.pack("<I", 9)) + chunk(b"btrs", bones)
    )
    return head + chunk(b"fram", frame)


def test_mocopis_bones_are_bones() -> None:
    left_45 = (math.cos(math.pi / 8), 0.0, math.sin(math.pi / 8), 0.0)  # right-handed, y up
    source = SourceSettings("arm", "mocopi", bone="l_low_arm").source()
    heard = source.hear(mocopi_messages(mocopi_frame({"root": left_45, "l_low_arm": left_45})), 0.0)
    assert heard is not None
    assert heading_deg(heard) == pytest.approx(90.0)


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_cut_datagrams_of_mocopi_are_refused(cut: int) -> None:
    whole = mocopi_frame({"root": (1.0, 0.0, 0.0, 0.0)})
    with pytest.raises(ValueError, match="no datagram of mocopi"):
        mocopi_messages(whole[:-cut])


def test_a_datagram_of_frames_within_frames_is_refused() -> None:
    """It ended show control, which hears it: Python nests a thousand calls."""
    nested = b""
    for _ in range(4000):
        nested = chunk(b"fram", nested)
    with pytest.raises(ValueError, match="no datagram of mocopi"):
        mocopi_messages(nested)


def test_every_program_has_a_source_with_its_own_values() -> None:
    for name, program in PROGRAMS.items():
        address = "/q" if name == "osc" else ""
        settings = SourceSettings("arm", name, address, bone="root" if program.has_bones else "")
        assert settings.source().hear([], 0.0) is None
