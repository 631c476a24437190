"""outputs.dmx of a box file: what it takes, and each fault with its line and cure."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.dmx import DmxConfig


def wires(folder: Path, *lines: str) -> list[DmxConfig]:
    """The entries of a box file; the first of them stands on line 3."""
    path = folder / "box.yaml"
    path.write_text("outputs:\n  dmx:\n" + "".join(f"    - {line}\n" for line in lines))
    return load_box(path).outputs.dmx


def test_without_a_word_no_light_is_sent_to() -> None:
    assert load_box(None).outputs.dmx == []


def test_every_wire_can_be_said(tmp_path: Path) -> None:
    entries = wires(
        tmp_path,
        "{universe: 1, wire: artnet, host: 192.168.0.30}",
        "{universe: 1, wire: artnet, host: 192.168.0.31}",
        "{universe: 2, wire: artnet, number: 0, host: 2.255.255.255, broadcast: true}",
        "{universe: 3, wire: sacn, priority: 150, interface: 192.168.0.9, source_name: Stage left, ttl: 4}",
        "{universe: 3, wire: usb-pro}",
        "{universe: 4, wire: usb-pro, device: /dev/ttyUSB1, channels: 128}",
        "{universe: 5, wire: open-dmx, serial: A50285BI}",
        "{universe: 6, wire: udmx}",
    )
    assert [entry.number_on_wire for entry in entries] == [1, 1, 0, 3, 3, 4, 5, 6]
    assert [entry.rate for entry in entries] == [40] * 6 + [30, 40]
    assert [entry.udp_port for entry in entries[:4]] == [6454, 6454, 6454, 5568]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("{universe: 0, wire: sacn}", "sACN has universes from 1 to 63999; 0 is none of them."),
        ("{universe: 64000, wire: sacn}", "sACN has universes from 1 to 63999; 64000 is none of them."),
        ("{universe: 1, number: 0, wire: sacn}", "sACN has universes from 1 to 63999; 0 is none of them."),
        ("{universe: -1, wire: artnet}", "Art-Net has universes from 0 to 32767; -1 is none of them."),
        ("{universe: 32768, wire: artnet}", "Art-Net has universes from 0 to 32767; 32768 is none of them."),
        ("{universe: 64000, wire: udmx}", "A box has universes from 0 to 63999; 64000 is none of them."),
        ("{universe: 64000, number: 1, wire: artnet}", "A box has universes from 0 to 63999; 64000"),
        ("{universe: 1, wire: artnet, channels: 513}", "'outputs.dmx[1].channels' is 513, out of range."),
        ("{universe: 1, wire: artnet, rate_hz: 45}", "'outputs.dmx[1].rate_hz' is 45, out of range."),
        ("{universe: 1, wire: sacn, priority: 201}", "'outputs.dmx[1].priority' is 201, out of range."),
        ("{universe: 1, wire: artnett}", "Did you mean 'artnet'?"),
        ("{universe: 1, wire: artnet, hots: 1.2.3.4}", "Did you mean 'host'?"),
        ("{universe: 1, wire: artnet, priority: 10}", "'priority' belongs to sacn, and this wire is artnet."),
        ("{universe: 1, wire: sacn, device: /dev/x}", "'device' belongs to usb-pro and open-dmx, and this"),
        ("{universe: 1, wire: artnet, host: 255.255.255.255}", "This address means every machine"),
        ("{universe: 1, wire: artnet, host: node}", "'node' is not an IPv4 address in numbers."),
        ("{wire: artnet}", "The key 'outputs.dmx[1].universe' is missing."),
        ("{universe: 9, wire: artnet}", "dmx[0] and dmx[1] send to the same place by Art-Net. Remove one"),
    ],
)
def test_a_fault_is_told_with_its_line(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        wires(tmp_path, "{universe: 9, wire: artnet}", line)
    (problem,) = refused.value.problems
    assert message in str(problem)
    assert problem.line == 4


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("{universe: 1, wire: sacn}", "{universe: 2, wire: sacn, number: 1}"),
        ("{universe: 1, wire: artnet}", "{universe: 1, wire: artnet, host: 127.0.0.1}"),
        ("{universe: 1, wire: usb-pro}", "{universe: 2, wire: usb-pro}"),
        ("{universe: 1, wire: usb-pro, device: /dev/x}", "{universe: 2, wire: open-dmx, device: /dev/x}"),
        ("{universe: 1, wire: udmx, serial: a}", "{universe: 1, wire: udmx, serial: a}"),
    ],
)
def test_no_two_entries_lead_to_the_same_light(tmp_path: Path, first: str, second: str) -> None:
    with pytest.raises(ConfigError, match="send to the same place") as refused:
        wires(tmp_path, first, second)
    assert refused.value.line == 4
