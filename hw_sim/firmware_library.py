"""The compiled firmware in its simulated world, by ctypes: firmware/host/wearable_c.h, one wearable each."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias, get_type_hints

from hw_sim.motions import Quaternion

LIBRARY = Path(__file__).resolve().parents[1] / "build" / "firmware" / "libwearable.so"
IMUS = ("bno055", "bno085", "lsm6dsv")  # the chips that can be wired
TO_ALL = 0xFFFFFFFF  # the address of a broadcast
LARGEST_DATAGRAM = 512
U64: TypeAlias = Annotated[int, c_uint64]
U32: TypeAlias = Annotated[int, c_uint32]
U16: TypeAlias = Annotated[int, c_uint16]
U8: TypeAlias = Annotated[int, c_uint8]
SERIAL_ROOM = 4096


class FirmwareMissingError(OSError):
    """The firmware was not compiled; the message says how to."""


class State(IntEnum):
    """Where pairing is, as firmware/wearable/src/core/status.h counts it."""

    NOT_PROVISIONED = 0
    JOINING = 1
    GREETING = 2
    LINKED = 3


class Status(ctypes.Structure):
    """Counters of the wearable and its world: wearable_status in wearable_c.h, field by field."""

    now_us: U64
    booted_at_us: U64
    joined_at_us: U64
    longest_unfed_us: U64
    longest_linked_step_us: U64
    boot_nonce: U32
    session: U32
    readings: U32
    skipped: U32
    unsent: U32
    malformed: U32
    foreign: U32
    forged: U32
    replayed: U32
    damaged_frames: U32
    joins: U32
    failed_joins: U32
    sent: U32
    refused: U32
    lost: U32
    unheard: U32
    flash_saves: U32
    power_ons: U32
    restarts: U32
    watchdog_bites: U32
    round_trip: U16
    battery_millivolts: U16
    is_on: U8
    is_light_on: U8
    is_joined: U8
    state: U8
    lane: U8
    has_imu: U8
    has_profile: U8
    calibration: U8
    taps: U8
    recoveries: U8
    rate_hz: U8
    battery: U8


Status._fields_ = [
    (name, hint.__metadata__[0]) for name, hint in get_type_hints(Status, include_extras=True).items()
]


class SentDatagram(NamedTuple):
    """A datagram from the wearable's radio, and its destination: (IPv4 address as a number, port)."""

    at_us: int
    address: tuple[int, int]
    data: bytes


class CompiledWearable:
    """One wearable with its world. Times are whole microseconds of virtual time, which never goes back.

    flash: an image from `flash_image`, None for a new board. first_us: what its own clock shows at power-on;
    drift_ppm: how much too fast that clock is. imu: one of IMUS. It starts switched off, out of reach of any
    network. Raises FirmwareMissingError when the firmware was not compiled, ValueError for bytes that are no
    image, or no such IMU.
    """

    def __init__(
        self,
        flash: bytes | None = None,
        *,
        seed: int = 1,
        start_us: int = 0,
        drift_ppm: float = 0.0,
        first_us: int = 0,
        imu: str = "bno055",
    ) -> None:
        self._library = load_library()
        image = flash or b""
        self._world = self._library.wearable_create(
            image, len(image), seed % (1 << 64), start_us, imu.encode()
        )
        if not self._world:
            known = imu in IMUS
            raise ValueError(
                "these bytes are no image of a wearable's flash" if known else f"no such IMU: {imu}"
            )
        self._library.wearable_set_clock(self._world, drift_ppm, first_us)
        self._library.wearable_set_access_point(self._world, False, start_us)
        self._buffer = (c_uint8 * SERIAL_ROOM)()

    def close(self) -> None:
        if self._world:
            self._library.wearable_destroy(self._world)
        self._world = None

    def power(self, is_on: bool) -> None:
        """The switch; the flash keeps what it has."""
        self._library.wearable_power(self._world, is_on)

    def step_until(self, us: int) -> int:
        """Runs on; gives the time reached, which is later when a call of the firmware blocked."""
        reached: int = self._library.wearable_step_until(self._world, us)
        return reached

    @property
    def status(self) -> Status:
        """As it is now."""
        status = Status()
        self._library.wearable_read_status(self._world, byref(status))
        return status

    def set_network(self, name: str, password: str) -> None:
        self._library.wearable_set_network(self._world, name.encode(), password.encode())

    def set_access_point(self, is_on: bool, at_us: int) -> None:
        """From that time on; announce it ahead for the sake of a join that blocks meanwhile."""
        self._library.wearable_set_access_point(self._world, is_on, at_us)

    def put_datagram(self, address: tuple[int, int], data: bytes) -> bool:
        """A datagram for the wearable, from there; whether its radio heard it."""
        return bool(self._library.wearable_put_datagram(self._world, *address, data, len(data)))

    def take_datagrams(self) -> list[SentDatagram]:
        """All that left since the last call."""
        taken = []
        at_us, ip, port = c_uint64(), c_uint32(), c_uint16()
        while count := self._library.wearable_take_datagram(
            self._world, byref(at_us), byref(ip), byref(port), self._buffer, LARGEST_DATAGRAM
        ):
            taken.append(SentDatagram(at_us.value, (ip.value, port.value), bytes(self._buffer[:count])))
        return taken

    def connect_cable(self, is_connected: bool) -> None:
        self._library.wearable_connect_cable(self._world, is_connected)

    def put_serial(self, data: bytes) -> int:
        """How many of the bytes the line took."""
        taken: int = self._library.wearable_put_serial(self._world, data, len(data))
        return taken

    def take_serial(self) -> bytes:
        """Bytes that the wearable wrote since the last call."""
        count = self._library.wearable_take_serial(self._world, self._buffer, SERIAL_ROOM)
        return bytes(self._buffer[:count])

    def stand(self, orientation: Quaternion) -> None:
        """The hand stands so from now on, in the sensor's axes."""
        self._library.wearable_stand(self._world, *orientation)

    def go_to(self, orientation: Quaternion, at_us: int) -> None:
        """The hand turns evenly from the last orientation to this one, and has it at that time."""
        self._library.wearable_go_to(self._world, at_us, *orientation)

    def double_tap(self) -> None:
        """With a finger, now."""
        self._library.wearable_double_tap(self._world)

    def inject(self, fault: str, times: int = 1) -> None:
        """Inject this many faults into the IMU; their names are in firmware/host/trouble.cpp."""
        if not self._library.wearable_inject(self._world, fault.encode(), times):
            raise ValueError(f"the simulated IMU has no fault {fault!r}")

    def set_trouble(self, trouble: str, amount: float) -> None:
        """Set how bad something is: a share, a rate, 1 and 0. Names as for `inject`, and more."""
        if not self._library.wearable_set_trouble(self._world, trouble.encode(), amount):
            raise ValueError(f"the simulated wearable has no trouble {trouble!r}")

    def set_battery(self, millivolts: int) -> None:
        self._library.wearable_set_battery(self._world, millivolts)

    def take_light(self) -> list[tuple[int, bool]]:
        """When the lamp went on and off since the last call: (virtual time, is on)."""
        at_us = c_uint64()
        changes = []
        while (change := self._library.wearable_take_light(self._world, byref(at_us))) >= 0:
            changes.append((at_us.value, bool(change)))
        return changes

    def flash_image(self) -> bytes:
        room = self._library.wearable_flash_image(self._world, None, 0)
        image = (c_uint8 * room)()
        self._library.wearable_flash_image(self._world, image, room)
        return bytes(image)


@cache
def load_library(path: Path = LIBRARY) -> ctypes.CDLL:
    """The shared library with the signatures of wearable_c.h. Raises FirmwareMissingError."""
    if not path.exists():
        raise FirmwareMissingError(
            f"the firmware was not compiled: there is no {path}. Build it with 'make firmware'; "
            "it needs these Debian packages: sudo apt-get install -y cmake g++ make"
        )
    library = ctypes.CDLL(str(path))
    world, data = c_void_p, c_char_p
    signatures: dict[str, tuple[type | None, Sequence[type]]] = {
        "create": (c_void_p, (data, c_uint32, c_uint64, c_uint64, data)),
        "destroy": (None, (world,)),
        "power": (None, (world, c_int)),
        "set_clock": (None, (world, c_double, c_uint64)),
        "step_until": (c_uint64, (world, c_uint64)),
        "read_status": (None, (world, POINTER(Status))),
        "set_network": (None, (world, c_char_p, c_char_p)),
        "set_access_point": (None, (world, c_int, c_uint64)),
        "put_datagram": (c_int, (world, c_uint32, c_uint16, data, c_uint16)),
        "take_datagram": (
            c_uint16,
            (world, POINTER(c_uint64), POINTER(c_uint32), POINTER(c_uint16), POINTER(c_uint8), c_uint16),
        ),
        "connect_cable": (None, (world, c_int)),
        "put_serial": (c_uint16, (world, data, c_uint16)),
        "take_serial": (c_uint16, (world, POINTER(c_uint8), c_uint16)),
        "stand": (None, (world, c_double, c_double, c_double, c_double)),
        "go_to": (None, (world, c_uint64, c_double, c_double, c_double, c_double)),
        "double_tap": (None, (world,)),
        "inject": (c_int, (world, c_char_p, c_uint32)),
        "set_trouble": (c_int, (world, c_char_p, c_double)),
        "set_battery": (None, (world, c_uint16)),
        "take_light": (c_int, (world, POINTER(c_uint64))),
        "flash_image": (c_uint32, (world, POINTER(c_uint8), c_uint32)),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"wearable_{name}")
        function.restype, function.argtypes = result, arguments
    return library
