"""`bunraku firewall`: rules for nft that let in what the box file opens to the network, and nothing else."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence
from typing import Annotated

import typer

from appliance.box.served import is_loopback
from appliance.cli.options import BoxFile, ChosenFile
from appliance.release.choice import box_of
from appliance.show.box import BoxConfig, load_box

_MDNS = 5353
_RULES = """\
#!/usr/sbin/nft -f
# Written by `bunraku firewall`: what the box file opens is let in, and nothing else.
table inet bunraku
delete table inet bunraku
table inet bunraku {{
	chain input {{
		type filter hook input priority filter; policy drop;
		iif lo accept
		ct state established,related accept
		ct state invalid drop
		meta l4proto {{ icmp, ipv6-icmp }} accept
		udp dport 68 udp sport 67 accept comment "an address by DHCP"
{rules}
	}}
	chain forward {{
		type filter hook forward priority filter; policy drop;
	}}
}}
"""


def firewall(
    box: BoxFile = None,
    chosen: ChosenFile = None,
    access_point: Annotated[
        list[str] | None,
        typer.Option(help="Network card of the access point that the sensors join; repeatable."),
    ] = None,
) -> None:
    """Print rules for nft that let in what the box file opens, and nothing else."""
    print(rules(load_box(box_of(box, chosen)), access_point or []), end="")


def rules(box: BoxConfig, access_points: Sequence[str] = ()) -> str:
    """One table of our own: all other tables stay as they are."""
    lines = [
        *_sensors(box),
        *_commands(box),
        *_remote(box),
        *_page(box),
        *_pair(box),
        *_own_network(access_points),
    ]
    return _RULES.format(rules="\n".join(f"\t\t{line}" for line in lines))


def _sensors(box: BoxConfig) -> Iterator[str]:
    udp = box.sensors.udp
    if udp is not None and udp.port and not is_loopback(udp.host):
        yield f'{_to(udp.host)}udp dport {udp.port} accept comment "sensors"'
    for one in box.sensors.foreign:
        if one.program is not None:
            yield from _from_senders(one.host, one.senders, one.usual_port, one.name)


def _commands(box: BoxConfig) -> Iterator[str]:
    """From the listed senders; with none listed, only from this machine, which needs no rule."""
    control = box.control
    if control is not None and control.senders:
        yield from _from_senders(control.host, control.senders, control.port, "commands")


def _remote(box: BoxConfig) -> Iterator[str]:
    """Timecode and MIDI, from the listed senders."""
    timecode, network = box.timecode, box.midi and box.midi.network
    if timecode is not None and timecode.source == "art-net":
        yield from _from_senders(timecode.host, timecode.senders, timecode.port, "timecode")
    if network:
        ports = f"{network.port}-{network.port + 1}"
        yield from _from_senders(network.host, network.senders, ports, "MIDI")


def _pair(box: BoxConfig) -> Iterator[str]:
    """The other box of a pair, and boxes in step."""
    pair = box.pair
    if pair is not None:
        yield from _from_senders(pair.host, pair.peer, pair.port, "the other box")
    locked = box.locked
    if locked is not None and not is_loopback(locked.host):
        for host, port in locked.ends:
            yield f'{_to(locked.host)}ip saddr {host} udp dport {port} accept comment "a box in step"'


def _page(box: BoxConfig) -> Iterator[str]:
    """The page, its name by mDNS, and the stream, from the listed viewers, IPv4 and IPv6 apart."""
    for served, name in ((box.console, "the page"), (box.projector.stream, "the stream")):
        if served is None or is_loopback(served.host) or not served.port:
            continue
        for family, version in (("ip", 4), ("ip6", 6)):
            networks = [one for one in served.viewers if ipaddress.ip_network(one).version == version]
            if networks:
                viewers = ", ".join(networks)
                yield f'{family} saddr {{ {viewers} }} tcp dport {served.port} accept comment "{name}"'
                if served is box.console:
                    yield f'{family} saddr {{ {viewers} }} udp dport {_MDNS} accept comment "its name"'


def _own_network(access_points: Sequence[str]) -> Iterator[str]:
    """Sensors on the box's own network ask it for addresses."""
    for card in access_points:
        yield f'iifname "{card}" udp dport 67 accept comment "addresses for sensors"'
        yield f'iifname "{card}" udp dport 53 accept comment "names for sensors"'


def _from_senders(host: str, senders: Sequence[str], ports: int | str, what: str) -> Iterator[str]:
    """Datagrams of these senders to this address; nothing where it is inside this machine."""
    if not is_loopback(host):
        where = f"{_to(host)}ip saddr {{ {', '.join(senders)} }}"
        yield f'{where} udp dport {ports} accept comment "{what}"'


def _to(host: str) -> str:
    return "" if host == "0.0.0.0" else f"ip daddr {host} "
