"""The serial ports of this machine, and on which of them a wearable's board is."""

from __future__ import annotations

from dataclasses import dataclass

from serial.tools import list_ports

from appliance.pose.correctable_error import CorrectableError

# USB vendor and product of the boards, from the Arduino cores' boards.txt: running, and in their bootloader.
# An ESP32-S3's own USB unit has the last ids, on a XIAO and on many other boards.
BOARDS = {
    (0x2341, 0x804E): "MKR1000",
    (0x2341, 0x824E): "MKR1000",
    (0x2341, 0x8054): "MKR WiFi 1010",
    (0x2341, 0x0070): "Nano ESP32",
    (0x2886, 0x0056): "XIAO ESP32-S3",
    (0x303A, 0x1001): "XIAO ESP32-S3",
}
_BOOTLOADERS = {(0x2341, 0x004E): "MKR1000", (0x2341, 0x024E): "MKR1000", (0x2341, 0x0054): "MKR WiFi 1010"}


class NoWearableError(CorrectableError):
    """No wearable was found, or several: which ports there are and what to do."""


@dataclass(frozen=True)
class FoundPort:
    """A serial port of this machine, and whether a wearable's board is on it, and which."""

    device: str
    description: str
    is_wearable: bool
    is_bootloader: bool = False
    board: str = ""

    def __str__(self) -> str:
        board = f"a wearable's board, {self.board}" if self.board else "a wearable's board"
        hint = board if self.is_wearable else self.description
        if self.is_bootloader:
            hint = f"{board} that waits for firmware: press its reset button once"
        return f"{self.device} ({hint})" if hint else self.device


def found_ports() -> list[FoundPort]:
    """The serial ports of this machine."""
    return [
        FoundPort(
            port.device,
            "" if port.description in ("n/a", None) else port.description,
            (port.vid, port.pid) in BOARDS,
            (port.vid, port.pid) in _BOOTLOADERS,
            BOARDS.get((port.vid, port.pid), _BOOTLOADERS.get((port.vid, port.pid), "")),
        )
        for port in sorted(list_ports.comports(), key=lambda port: port.device)
    ]


def only_wearable(ports: list[FoundPort]) -> str:
    """The device of the one wearable that is plugged in. Raises NoWearableError that lists what there is."""
    wearables = [port for port in ports if port.is_wearable]
    if len(wearables) == 1:
        return wearables[0].device
    if wearables:
        raise NoWearableError(
            f"{len(wearables)} wearables are plugged in: {', '.join(port.device for port in wearables)}. "
            "Leave one, or say which with --port."
        )
    raise NoWearableError(f"No wearable is plugged in. {ports_sentence(ports)}")


def ports_sentence(ports: list[FoundPort]) -> str:
    """The message for a missing or wrong port."""
    if not ports:
        return (
            "This machine has no serial port at all. Plug the wearable in with a USB cable that carries data "
            "(many only carry power) and switch it on."
        )
    return f"Serial ports here: {', '.join(map(str, ports))}. Say which one with --port."
