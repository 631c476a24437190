"""From the box file's entries to universes on open wires."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from appliance.outputs.datagram_sender import DatagramPath
from appliance.outputs.dmx import sacn_packet
from appliance.outputs.dmx.art_net import ArtNetWire
from appliance.outputs.dmx.open_dmx import open_dmx_wire
from appliance.outputs.dmx.pace import Universe
from appliance.outputs.dmx.sacn import LOOPBACK, SacnSource, SacnWire, component_identifier
from appliance.outputs.dmx.udmx import udmx_wire
from appliance.outputs.dmx.usb_pro import usb_pro_wire
from appliance.outputs.dmx.wire import Wire
from appliance.show.dmx import DmxConfig


def open_universes(
    configs: Sequence[DmxConfig], state: Path | None = None, usb_backend: Any = None
) -> tuple[Universe, ...]:
    """All universes of a box, in the order of its box file. Never raises: see `Wire.trouble`.

    state: the box's state folder, which keeps its sACN identity.
    usb_backend: pyusb's; None for the machine's libusb.
    """
    sources = _sources(configs, state)
    return tuple(
        Universe(config, open_wire(config, source, usb_backend))
        for config, source in zip(configs, sources, strict=True)
    )


def open_wire(config: DmxConfig, source: SacnSource | None, usb_backend: Any = None) -> Wire:
    """The wire of one entry; `source`: for sACN alone."""
    if config.wire == "artnet":
        return ArtNetWire(config)
    if source is not None:
        return SacnWire(config, source)
    if config.wire == "usb-pro":
        return usb_pro_wire(config)
    if config.wire == "open-dmx":
        return open_dmx_wire(config)
    return udmx_wire(config, usb_backend)


def _sources(configs: Sequence[DmxConfig], state: Path | None) -> list[SacnSource | None]:
    """The source of each entry: one for each network that sACN leaves by, all with this box's identity."""
    if not any(config.wire == "sacn" for config in configs):
        return [None] * len(configs)
    cid = component_identifier(state)
    by_interface: dict[str, SacnSource] = {}
    sources: list[SacnSource | None] = []
    for config in configs:
        if config.wire != "sacn":
            sources.append(None)
            continue
        interface = config.interface or _interface_to(config.host, config.udp_port)
        if interface not in by_interface:
            group = sacn_packet.group(sacn_packet.DISCOVERY_UNIVERSE)
            path = DatagramPath(group, config.udp_port, interface, hops=config.ttl)
            by_interface[interface] = SacnSource(cid, config.source_name, path)
        sources.append(by_interface[interface])
    return sources


def _interface_to(host: str | None, port: int) -> str:
    """The address of the interface by which the kernel reaches a host; inside this machine without one."""
    if host is None:
        return LOOPBACK
    try:
        return DatagramPath(host, port).own_address()
    except OSError:
        return LOOPBACK
