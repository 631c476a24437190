"""Phones in place of sensors, at the prompt: which ones, their codes, and QR codes for a terminal."""

from __future__ import annotations

import logging
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from appliance.box.served import is_loopback, own_networks
from appliance.console.join_codes import VALID_S, JoinCodes
from appliance.stage.stage_error import StageError

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig
    from appliance.show.show import ShowConfig

_log = logging.getLogger(__name__)

_HOST, _MOST_NETWORKS = "0.0.0.0", 32


def phone_names(box: BoxConfig) -> tuple[str, ...]:
    """The sensors that phones may be."""
    return tuple(one.name for one in box.sensors.foreign if one.from_ == "phone")


def out_of_phones_reach(box: BoxConfig) -> list[str]:
    """Why phones cannot be the sensors that the box file lets them be."""
    names, console = ", ".join(phone_names(box)), box.console
    if not names:
        return []
    moves_freely = f"The dancer moves freely where {names} should hold."
    if console is None:
        return [f"Phones open the page, and this box file says `console: null`. {moves_freely} Remove it."]
    if is_loopback(console.host):
        cure = "Write `console: {host: '::', https: true, viewers: [192.168.0.0/24]}`."
        return [f"No phone reaches the page: it is served on {console.host}. {moves_freely} {cure}"]
    if not console.https:
        cure = "Write `https: true` under console."
        return [f"Browsers give no motion to a page without HTTPS. {moves_freely} {cure}"]
    return []


def with_phone(show: ShowConfig, box: BoxConfig) -> BoxConfig:
    """The box with a phone as the show's first sensor, and with a page that phones in this machine's networks
    can open.

    Raises StageError where the show has no sensor, the box no page, or this machine no openssl.
    """
    from appliance.show.foreign_sensors import ForeignSensorConfig

    worn = [hand.sensor for _, hand in show.hands_at if hand.sensor]
    if not worn:
        raise StageError("This show has no sensor that a phone could be. Leave --phone out.")
    if box.console is None:
        raise StageError(
            "A phone opens the page of the box, and this box file says `console: null`. Remove it, or leave "
            "--phone out."
        )
    if shutil.which("openssl") is None:
        raise StageError(
            "A phone gives its motion only to an encrypted page, and the command openssl, which makes its "
            "certificate, is missing. On Debian: sudo apt-get install openssl. Or leave --phone out."
        )
    sensors, console = box.sensors, box.console
    if worn[0] not in phone_names(box):
        others = [one for one in sensors.foreign if one.name != worn[0]]
        phone = ForeignSensorConfig.model_validate({"name": worn[0], "from": "phone"})
        sensors = sensors.model_copy(update={"foreign": [*others, phone]})
    opened = {
        "https": True,
        "host": _HOST if is_loopback(console.host) else console.host,
        "viewers": console.viewers or own_networks()[:_MOST_NETWORKS],
    }
    console = console.model_copy(update=opened)
    return box.model_copy(update={"sensors": sensors, "console": console})


def offer_phones(folder: Path, origin: str, names: tuple[str, ...], box_option: str) -> None:
    """Log how each phone becomes its sensor: by a QR code where there is a terminal. origin: of the page."""
    try:
        codes = JoinCodes(folder)
        codes.set_names(names)
        for name in names:
            for line in invitation(codes, origin, name, sys.stdout.isatty()):
                _log.info(line)
    except OSError as error:
        _log.warning(
            f"{folder}: no codes for phones can be kept there ({error.strerror}). They need the PIN."
        )
        return
    _log.info(f"Another phone: bunraku console phone NAME{box_option}")


def invitation(codes: JoinCodes, origin: str, name: str, with_picture: bool) -> Iterator[str]:
    """Lines that let one phone be this sensor. Raises KeyError for another name, and OSError."""
    from appliance.console.phone_address import phone_address, squares

    address = phone_address(origin, name, codes.new_code(name, time.monotonic()))
    if with_picture:
        yield from _blocks(squares(address))
    yield f"A phone in this machine's network becomes {name} at {address}"
    yield (
        f"For one phone, within {VALID_S / 60:.0f} minutes. Its browser warns once that the box made its "
        "certificate itself: go on."
    )


def _blocks(squares: list[str], margin: int = 4) -> Iterator[str]:
    """Half a character for each square, light on dark: a terminal's usual colours do not matter."""
    width = len(squares[0]) + 2 * margin
    empty = ["0" * width] * margin
    rows = [*empty, *("0" * margin + row + "0" * margin for row in squares), *empty]
    rows += ["0" * width] * (len(rows) % 2)
    signs = {"00": "█", "01": "▀", "10": "▄", "11": " "}
    for above, below in zip(rows[::2], rows[1::2], strict=True):
        line = "".join(signs[one + other] for one, other in zip(above, below, strict=True))
        yield f"\033[97;40m{line}\033[0m"
