"""The doctor's checks of what the venue brings: radios, network, cables, adapters, displays, ports."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from appliance.cli.doctor import venue
from appliance.cli.doctor.host_view import HostView
from appliance.show.box import BoxConfig
from tests.system.machine_of_files import lay, only, verdicts


def test_radios(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/class/rfkill/rfkill0/type", "bluetooth\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/name", "hci0\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/soft", "0\n")
    lay(tmp_path, "/sys/class/net/wlan0/phy80211/name", "phy0\n")
    lay(tmp_path, "/sys/drivers/brcmfmac/name")
    (tmp_path / "sys/class/net/wlan0/device").mkdir()
    (tmp_path / "sys/class/net/wlan0/device/driver").symlink_to(tmp_path / "sys/drivers/brcmfmac")
    lay(tmp_path, "/data/network/sensors.nmconnection")
    assert verdicts(venue.radios(HostView(tmp_path))) == [("bluetooth", "better"), ("wi-fi", "better")]


def test_an_access_point_that_is_not_on_the_air_is_wrong(tmp_path: Path) -> None:
    lay(tmp_path, "/data/network/sensors.nmconnection", "[connection]\ninterface-name=wlan7\n")
    found = only(venue.radios(HostView(tmp_path)))
    assert found.verdict == "wrong" and "wlan7 is not plugged in" in found.message
    lay(tmp_path, "/sys/class/net/wlan7/phy80211/name", "phy7\n")
    assert list(venue.radios(HostView(tmp_path))) == []
    lay(tmp_path, "/sys/class/rfkill/rfkill0/type", "wlan\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/name", "phy7\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/soft", "1\n")
    assert only(venue.radios(HostView(tmp_path))).verdict == "wrong"
    (tmp_path / "data/network/sensors.nmconnection").unlink()
    assert only(venue.radios(HostView(tmp_path))).verdict == "ok", "sensors by a router"


def test_a_network_without_a_cable(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/class/net/eth0/carrier", "0\n")
    (tmp_path / "sys/class/net/eth0/device").mkdir()
    assert only(venue.network(HostView(tmp_path))).verdict == "better"
    lay(tmp_path, "/sys/class/net/eth0/carrier", "1\n")
    assert only(venue.network(HostView(tmp_path))).verdict == "ok"


def test_cables_and_adapters(tmp_path: Path) -> None:
    wires = [
        {"universe": 1, "wire": "udmx"},
        {"universe": 2, "wire": "usb-pro", "device": str(tmp_path / "tty")},
    ]
    box = BoxConfig.model_validate(
        {"sensors": {"serial": [{"device": "/dev/ttyACM0"}]}, "outputs": {"dmx": wires}},
        context={"directory": tmp_path},
    )
    assert only(venue.cables(HostView(tmp_path, box))).verdict == "wrong"
    lay(tmp_path, "/dev/ttyACM0")
    assert only(venue.cables(HostView(tmp_path, box))).verdict == "ok"
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idVendor", "16c0\n")
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idProduct", "05dc\n")
    assert [one.verdict for one in venue.adapters(HostView(tmp_path, box))] == ["ok", "ok"]
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idProduct", "0001\n")
    assert next(iter(venue.adapters(HostView(tmp_path, box)))).verdict == "wrong"
    here = [one.verdict for one in venue.adapters(HostView(Path("/"), box))]
    assert here[1] == "wrong"  # the path that the box file names is not there
    (tmp_path / "tty").touch()
    assert [one.verdict for one in venue.adapters(HostView(Path("/"), box))][1] == "ok"


def test_adapters_that_are_left_out_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    cables = []
    for number in range(2):
        cable = ListPortInfo(f"/dev/ttyUSB{number}", skip_link_detection=True)
        cable.vid, cable.pid, cable.serial_number = 0x0403, 0x6015, f"D{number}"
        cables.append(cable)
    monkeypatch.setattr(list_ports, "comports", lambda: cables)
    wires = [{"universe": 1, "wire": "open-dmx"}]
    box = BoxConfig.model_validate({"outputs": {"dmx": wires}}, context={})
    found = only(venue.adapters(HostView(box=box)))
    assert found.verdict == "better"
    assert "It takes /dev/ttyUSB0" in found.message and "/dev/ttyUSB1 (serial: D1)" in found.message


def test_displays(tmp_path: Path) -> None:
    assert verdicts(venue.display(HostView(tmp_path))) == [("display", "better"), ("graphics", "better")]
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-1/status", "connected\n")
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-2/status", "disconnected\n")
    lay(tmp_path, "/dev/dri/renderD128")
    found = only(venue.display(HostView(tmp_path)))
    assert found.verdict == "ok"
    assert "HDMI-A-1" in found.message
    assert "HDMI-A-2" not in found.message


def test_a_port_that_another_process_holds_is_wrong_and_it_is_named(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        box = BoxConfig.model_validate({"sensors": {"udp": {"port": port}}, "control": None})
        found = next(iter(venue.ports(HostView(box=box))))
        name = Path(f"/proc/{os.getpid()}/comm").read_text().strip()
        assert (found.verdict, f"{name} (process {os.getpid()})" in found.message) == ("wrong", True)
    assert next(iter(venue.ports(HostView(box=box)))).verdict == "ok"


@pytest.fixture
def radio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> HostView:
    """This machine, whose loopback plays the access point's card; stand-ins say what `tmp_path` has."""
    for name in ("iw", "ip"):
        (tmp_path / name).write_text(f'#!/bin/sh\ncat "{tmp_path}/{name} $*"\n')
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(venue, "_access_point_card", lambda _: "lo")
    (tmp_path / "iw reg get").write_text("global\ncountry DE: DFS-ETSI\n")
    (tmp_path / "iw dev lo station dump").write_text("Station 1 (on lo)\n\tx: 2\nStation 2 (on lo)\n")
    (tmp_path / "ip -brief address show dev lo").write_text("lo UP 10.77.0.1/24\n")
    return HostView()


def test_what_the_access_point_really_does_is_said(radio: HostView, tmp_path: Path) -> None:
    reported = tmp_path / "iw dev lo info"
    reported.write_text("Interface lo\n\tssid stage net\n\ttype AP\n\tchannel 6 (2437 MHz), width: 20 MHz\n")
    found = only(venue.access_point(radio))
    assert found.verdict == "ok"
    assert "lo is on the air as 'stage net', channel 6 (2437 MHz), country DE; 2 joined." in found.message
    (tmp_path / "ip -brief address show dev lo").write_text("lo DOWN\n")
    assert "no address" in only(venue.access_point(radio)).message
    reported.write_text("Interface lo\n\ttype managed\n")
    found = only(venue.access_point(radio))
    assert found.verdict == "wrong" and "not on the air (it is 'managed')" in found.message
