"""Joins the Wi-Fi that bunraku-wifi.yaml names, or makes it; `bunraku-wifi.service` runs this as root.

    python -m appliance.cli.join_wifi

Looks on the stick, then on the boot partition. A new file is kept in /data/network, with NetworkManager's
profile of it, and takes effect at once. A file with a fault changes nothing.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from appliance.box.child import finished
from appliance.box.durable import write_whole
from appliance.pose.foreign_file import TooLargeError, content
from appliance.release.choice import RUN
from appliance.release.wifi import NAME, PROFILE, WifiFile, is_filled_in, profile, read_wifi, unescaped
from appliance.show.config_error import ConfigError
from appliance.show.yaml_file import MAX_BYTES

MESSAGE_FILE = "wifi.txt"  # in the run folder: what went wrong, for the test card and the doctor
NETWORK_FILE = "access-point.txt"  # there too: the box's own network and its password, for the test card
_ACCESS_POINT_PROFILE = "sensors.nmconnection"  # by bunraku-access-point
_AVAHI = ("org.freedesktop.Avahi", "/", "org.freedesktop.Avahi.Server")  # took the name at its own start
_SAID = ("wi-fi", "ssid"), ("password", "psk")
_CARD_S, _JOINED_S = 20.0, 40.0
_RETRY_S = 0.5


class WifiFolders(NamedTuple):
    """arrivals: folders that may bring a file, the first that has one counts; kept: over power-off; run:
    where messages are left; profiles: NetworkManager's own folder in memory."""

    arrivals: tuple[Path, ...] = (Path("/media/bunraku"), Path("/boot"), Path("/boot/firmware"))
    saved: Path = Path("/data/network")
    run: Path = RUN
    profiles: Path = Path("/run/NetworkManager/system-connections")
    cards: Path = Path("/sys/class/net")


Run = Callable[[Sequence[str]], subprocess.CompletedProcess[str]]
Wait = Callable[[float], None]
NameBox = Callable[[str], None]


def join_wifi(folders: WifiFolders, run: Run, wait: Wait, name_box: NameBox) -> int:
    """Apply the newest file; 0, or 1 with a message in the run folder."""
    message = _applied(folders, run, wait, name_box)
    _leave(folders.run / MESSAGE_FILE, message)
    _leave(folders.run / NETWORK_FILE, _own_network(folders.saved / _ACCESS_POINT_PROFILE))
    if message:
        print(message, flush=True)
    return 1 if message else 0


def _leave(path: Path, text: str) -> None:
    """For the services, which are not root; no file where there is nothing to say."""
    with contextlib.suppress(OSError):
        if text:
            write_whole(path, f"{text}\n".encode(), private=True)
        else:
            path.unlink(missing_ok=True)


def _own_network(path: Path) -> str:
    """Name and password, one a line, of the network that the box makes; empty where it makes none."""
    try:
        values = dict(line.split("=", 1) for line in path.read_text().splitlines() if "=" in line)
    except OSError:
        return ""
    return "\n".join(f"{word} {unescaped(values.get(key, ''))}" for word, key in _SAID)


def _applied(folders: WifiFolders, run: Run, wait: Wait, name_box: NameBox) -> str:
    """The fault as a message; empty if all is well or no Wi-Fi is asked for."""
    saved = folders.saved / NAME
    read = ((path, _content(path)) for path in (*(one / NAME for one in folders.arrivals), saved))
    try:  # each is read once: its stick may be pulled while the network is looked for
        path, data = next(((path, data) for path, data in read if data), (saved, b""))
        if not data:
            return ""
        wifi = read_wifi(path, data)
    except TooLargeError as error:
        return f"{NAME} cannot be read ({error.strerror}). The box keeps the network from before."
    except ConfigError as error:
        message = str(error).replace(f"{path.parent}/", "")  # the wall has room for little
        return f"{message}\nThe box keeps the network from before."
    name_box(wifi.hostname)
    is_new = not saved.is_file() or saved.read_bytes() != data
    try:
        if is_new:
            write_whole(folders.saved / "country", f"COUNTRY={wifi.country}\n".encode())
    except OSError as error:
        return (
            f"{folders.saved} cannot be written ({error.strerror}): the box is in no Wi-Fi. Look at its disk."
        )
    card = _card(folders.cards, wait)
    if not card:
        return "The box has no Wi-Fi card that works. Plug an adapter in, or a network cable."
    run(("iw", "reg", "set", wifi.country))
    message = (
        _made(folders, wifi, card, is_new, run) if wifi.access_point else _joined(folders, wifi, is_new, run)
    )
    if is_new and not (message and wifi.access_point):
        write_whole(saved, data, private=True)
    return message


def _content(path: Path) -> bytes:
    """The file, if it asks for a network; empty if not, or if it cannot be read. Raises TooLargeError."""
    try:
        data = content(path, MAX_BYTES)
    except TooLargeError:
        raise
    except OSError:
        return b""
    return data if is_filled_in(data.decode("utf-8", "replace")) else b""


def _card(cards: Path, wait: Wait) -> str:
    """The first Wi-Fi card; a Pi's own takes seconds to appear."""
    for _ in range(int(_CARD_S / _RETRY_S)):
        for one in sorted(cards.glob("*/phy80211")):
            return one.parent.name
        wait(_RETRY_S)
    return ""


def _joined(folders: WifiFolders, wifi: WifiFile, is_new: bool, run: Run) -> str:
    text = profile(wifi).encode()
    if is_new:
        with contextlib.suppress(FileNotFoundError):
            (folders.saved / _ACCESS_POINT_PROFILE).unlink()
            (folders.profiles / _ACCESS_POINT_PROFILE).unlink()
        write_whole(folders.saved / PROFILE, text, private=True)
    folders.profiles.mkdir(parents=True, exist_ok=True)
    write_whole(folders.profiles / PROFILE, text, private=True)
    run(("nmcli", "connection", "reload"))
    done = run(("nmcli", "--wait", f"{_JOINED_S:.0f}", "connection", "up", "id", "wifi"))
    if done.returncode == 0:
        return ""
    why = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "NetworkManager does not say why"
    return (
        f"The box is not in the Wi-Fi '{wifi.name}' ({why}). It tries again by itself. "
        f"Look at name and password in {NAME}, and whether the router is on."
    )


def _made(folders: WifiFolders, wifi: WifiFile, card: str, is_new: bool, run: Run) -> str:
    if not is_new:
        return ""  # NetworkManager has started it
    for folder in (folders.saved, folders.profiles):
        (folder / PROFILE).unlink(missing_ok=True)
    given = {"card": card, "country": wifi.country, "name": wifi.name, "password": wifi.password}
    options = [word for option, value in given.items() for word in (f"--{option}", value)]
    done = run(("bunraku-access-point", *options, "--channel", str(wifi.channel)))
    return "" if done.returncode == 0 else done.stderr.strip() or "The access point did not start."


def main() -> int:
    """For the unit; the exit status."""
    return join_wifi(WifiFolders(), finished, time.sleep, _name_box)


def _name_box(name: str) -> None:
    with contextlib.suppress(OSError):
        socket.sethostname(name)
        finished(("busctl", "call", *_AVAHI, "SetHostName", "s", name))


if __name__ == "__main__":
    sys.exit(main())
