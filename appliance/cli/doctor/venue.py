"""Checks everything plugged in and reachable: ports, network, radios, cables, lights' adapters, display."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from serial.tools.list_ports_common import ListPortInfo

from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView, output_of
from appliance.cli.pair import is_well, sentence
from appliance.outputs.dmx.adapter_wire import AdapterError
from appliance.outputs.dmx.serial_port import (
    adapters_here,
    find_device,
    is_bare_ftdi,
    is_usb_pro,
)
from appliance.show.box import out_of_reach
from appliance.show.dmx import WIRE_NAMES, DmxConfig

_KINDS: dict[str, Callable[[ListPortInfo], bool]] = {"usb-pro": is_usb_pro, "open-dmx": is_bare_ftdi}
_UDMX = ("16c0", "05dc")


def ports(host: HostView) -> Iterator[Finding]:
    """The box's own ports are free, or the box has them."""
    udp, control = host.box.sensors.udp, host.box.control
    wanted = [("sensors", udp.host, udp.port)] if udp is not None else []
    wanted += [("commands", control.host, control.port)] if control is not None else []
    for user, address, port in wanted:
        holders = _holders(host, port) if port else []
        others = [name for name, is_ours in holders if not is_ours]
        if not holders:
            yield ok(f"port for {user}", f"{address}:{port} is free.")
        elif not others:
            yield ok(f"port for {user}", f"{address}:{port}: the box listens.")
        else:
            names = ", ".join(others)
            yield wrong(
                f"port for {user}",
                f"{names} has UDP port {port}: the box would receive nothing there.",
                "End that program, or give the box another port in its box file.",
            )
    if (message := out_of_reach(host.box.sensors)) is not None:
        yield better("sensors by Wi-Fi", message, "If all sensors are on cables, leave it as it is.")


def pair(host: HostView) -> Iterator[Finding]:
    """The other box of a pair is there, and could take over; boxes in step are so."""
    if (host.box.pair is None and host.box.locked is None) or host.stage is None:
        return
    name, key = ("in step", "in_step") if host.box.pair is None else ("pair", "pair")
    reported = host.stage.health.get(key)
    if not reported:
        yield better(name, "This stage notes no journal, so no box can follow it.", "Free memory, restart.")
    elif is_well(reported):
        yield ok(name, sentence(reported))
    else:
        cure = "Switch the other box on; give it the same show, release and secret; look at the cable."
        yield better(name, sentence(reported), cure)


def _holders(host: HostView, port: int) -> list[tuple[str, bool]]:
    """(name, whether it is one of the box's) of each process that has this UDP port."""
    rows = [line.split() for line in (host.text("/proc/net/udp") or "").splitlines()]
    inodes = {f"socket:[{row[9]}]" for row in rows if len(row) > 9 and row[1].endswith(f":{port:04X}")}
    found = []
    for folder in host.found("/proc/[0-9]*") if inodes else []:
        if inodes & set(_links(host.at(folder / "fd"))):
            name = f"{host.text(folder / 'comm')} (process {folder.name})"
            found.append((name, host.is_bunraku(folder)))
    return found or [("another user's program", False)] * bool(inodes)


def _links(folder: Path) -> Iterator[str]:
    """Targets of the links in a folder; a link that is gone when it is read is skipped."""
    with contextlib.suppress(OSError):
        for entry in os.scandir(folder):
            with contextlib.suppress(OSError):
                yield str(Path(entry.path).readlink())


def network(host: HostView) -> Iterator[Finding]:
    """Is any network there?"""
    names = [card.parent.name for card in host.found("/sys/class/net/*/carrier")]
    cards = [name for name in names if host.at(f"/sys/class/net/{name}/device").exists()]  # hardware
    connected = [name for name in cards if host.text(f"/sys/class/net/{name}/carrier") == "1"]
    if connected:
        yield ok("network", f"{', '.join(connected)}: connected.")
    elif cards:
        yield better(
            "network",
            f"{', '.join(cards)}: nothing is connected. Sensors by Wi-Fi and receivers miss the box.",
            "Plug in the router, and look at the lamps of both sockets.",
        )


def radios(host: HostView) -> Iterator[Finding]:
    """Wi-Fi that saves power or is switched off, Bluetooth that interferes, a Pi's own access point."""
    for switch in host.found("/sys/class/rfkill/rfkill*"):
        kind, name = host.text(switch / "type"), host.text(switch / "name")
        blocked = host.text(switch / "soft") == "1" or host.text(switch / "hard") == "1"
        if kind == "bluetooth" and not blocked:
            yield better(
                "bluetooth",
                f"{name} is on. It shares 2.4 GHz with the sensors.",
                "`sudo rfkill block bluetooth`",
            )
        elif kind == "wlan" and blocked and _is_access_point(host):
            yield wrong(
                "wi-fi",
                f"{name} is switched off, and this box is the sensors' access point: none of them joins.",
                "`sudo bunraku-access-point --country CC`, with the country's two letters, or the adapter's "
                "own switch.",
            )
        elif kind == "wlan" and blocked:
            yield ok(
                "wi-fi", f"{name} is switched off here: the sensors need a router, which is better anyway."
            )
    if (wanted := _access_point_card(host)) and not host.at(f"/sys/class/net/{wanted}").exists():
        yield wrong(
            "wi-fi",
            f"{wanted} is not plugged in, and this box is the sensors' access point on it: none joins.",
            "Plug the adapter in, or `sudo bunraku-access-point --remove` and use a router.",
        )
    for card in (path.parent for path in host.found("/sys/class/net/*/phy80211")):
        driver = host.at(card / "device/driver").resolve().name
        if driver.startswith("brcmf") and _is_access_point(host):
            yield better(
                "wi-fi",
                f"{card.name} is the access point, on a Pi's own radio: it loses clients after hours.",
                "A router for 2.4 GHz on Ethernet.",
            )
        if host.is_here and "on" in output_of("iw", "dev", card.name, "get", "power_save").split()[-1:]:
            yield better(
                "wi-fi",
                f"{card.name} saves power: readings wait for up to 100 ms.",
                f"`sudo iw dev {card.name} set power_save off`, or wifi.powersave=2 for NetworkManager.",
            )


def _is_access_point(host: HostView) -> bool:
    """Whether `bunraku-access-point` has made one."""
    return bool(host.found("/data/network/sensors.nmconnection"))


def _access_point_card(host: HostView) -> str:
    """The card that `bunraku-access-point` was told to use; "" where it was not."""
    lines = (host.text("/data/network/sensors.nmconnection") or "").splitlines()
    return next((line.partition("=")[2] for line in lines if line.startswith("interface-name=")), "")


def access_point(host: HostView) -> Iterator[Finding]:
    """Whether the card does as `bunraku-access-point` told it: asks the kernel, not the settings."""
    card = _access_point_card(host)
    if not card or not host.is_here or not host.at(f"/sys/class/net/{card}").exists():
        return
    what, reported = "access point", output_of("iw", "dev", card, "info")
    lines = [line.split() for line in reported.splitlines()]
    facts = {words[0]: " ".join(words[1:]) for words in lines if len(words) > 1}
    if not reported:
        yield better(what, "Nobody says what the radio does: `iw` is missing.", "`sudo apt-get install iw`")
    elif facts.get("type") != "AP":
        yield wrong(
            what,
            f"{card} is not on the air (it is '{facts.get('type', 'nothing')}'): no sensor joins.",
            "`journalctl -u NetworkManager` says why; `sudo bunraku-access-point` sets it again.",
        )
    else:
        channel = facts.get("channel", "?").partition(",")[0]
        here = "10.77.0.1/" in output_of("ip", "-brief", "address", "show", "dev", card)
        joined = output_of("iw", "dev", card, "station", "dump").count("Station ")
        country = output_of("iw", "reg", "get").partition("country ")[2][:2] or "unknown"
        message = (
            f"{card} is on the air as '{facts.get('ssid', '')}', channel {channel}, country {country}; "
            f"{joined} joined."
        )
        if here:
            yield ok(what, message)
        else:
            yield wrong(
                what,
                f"{message} It has no address: sensors find no box.",
                "`sudo systemctl restart NetworkManager`, then look again.",
            )


def cables(host: HostView) -> Iterator[Finding]:
    """Sensors on cables that the box file names."""
    for cable in host.box.sensors.serial:
        yield _device(host, f"sensor on {cable.device}", cable.device)
    if host.found("/run/systemd/units/invocation:ModemManager.service"):
        yield better(
            "cables",
            "ModemManager runs: it speaks to each new cable first, for seconds.",
            "`sudo systemctl disable --now ModemManager`",
        )


def adapters(host: HostView) -> Iterator[Finding]:
    """The lights' USB adapters that the box file names."""
    for wire in host.box.outputs.dmx:
        what = f"lights, universe {wire.universe}"
        if wire.wire == "udmx":
            yield _udmx(host, what)
        elif wire.wire in _KINDS:
            yield _adapter(host, what, wire)


def _udmx(host: HostView, what: str) -> Finding:
    for device in host.found("/sys/bus/usb/devices/*/idVendor"):
        if (host.text(device), host.text(device.with_name("idProduct"))) == _UDMX:
            return ok(what, "The uDMX is plugged in.")
    return wrong(
        what, "No uDMX is plugged in: its lamps stay as they are.", "Plug it in: it is taken by itself."
    )


def _adapter(host: HostView, what: str, wire: DmxConfig) -> Finding:
    if not host.is_here:
        return ok(what, "It is looked for on the machine itself.")
    try:
        device = find_device(wire.device, wire.serial, _KINDS[wire.wire])
    except AdapterError as error:
        return wrong(
            what,
            f"{WIRE_NAMES[wire.wire]}: {error}. Its lamps stay as they are.",
            "Plug it in: it is taken by itself.",
        )
    others = [port for port in adapters_here(_KINDS[wire.wire]) if port.device != device]
    if others and wire.device is None and wire.serial is None:
        listed = ", ".join(f"{port.device} (serial: {port.serial_number})" for port in others)
        return better(
            what,
            f"It takes {device}, the first adapter of its kind. Also plugged in: {listed}.",
            "Say which one: its USB serial number as `serial:` of the wire in the box file.",
        )
    return _device(host, what, device)


def _device(host: HostView, what: str, device: str) -> Finding:
    there = host.at(device)
    if not there.exists():
        return wrong(what, f"{device} is not plugged in.", "Plug it in: it is taken by itself.")
    if not os.access(there, os.R_OK | os.W_OK):
        return wrong(
            what, f"This user may not open {device}.", "`sudo usermod -aG dialout USER`, log in again."
        )
    return ok(what, f"{device} is there.")


def display(host: HostView) -> Iterator[Finding]:
    """Is there somewhere to project, and something that draws?"""
    sockets = host.found("/sys/class/drm/card*-*/status")
    connected = [path.parent.name for path in sockets if host.text(path) == "connected"]
    if connected:
        yield ok("display", f"{', '.join(connected)}: connected.")
    else:
        yield better(
            "display",
            "None is connected: no picture. Dance and lights go on.",
            "Projector on, cable in. One that sleeps needs `video=HDMI-A-1:1920x1080M@60D` in the kernel's "
            "command line.",
        )
    if not host.found("/dev/dri/renderD*"):
        yield better(
            "graphics",
            "No graphics card: the processor draws, in fewer and smaller pictures.",
            "The card's driver, or a machine with one. A dance without a projector needs none.",
        )
