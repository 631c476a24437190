"""outputs.dmx of box.yaml: which universe of lights leaves by which wire."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, model_validator

from appliance.show.section import Ipv4, Section, SerialDevice, key, refusal

WireKind = Literal["artnet", "sacn", "usb-pro", "open-dmx", "udmx"]

LAST_UNIVERSE = 63999
SLOTS = 512  # channels of a universe
FASTEST_HZ = 44.0  # a full universe lasts 22.7 ms on the wire (ANSI E1.11)
NUMBERS = {"artnet": (0, 32767), "sacn": (1, LAST_UNIVERSE)}  # 15 bits; E1.31 section 6.2.7
WIRE_NAMES = {
    "artnet": "Art-Net",
    "sacn": "sACN",
    "usb-pro": "ENTTEC DMX USB Pro",
    "open-dmx": "Open DMX",
    "udmx": "uDMX",
}
_USUAL_HZ = {"open-dmx": 30.0}
_PORTS = {"artnet": 6454, "sacn": 5568}
_OWN_KEYS: dict[str, tuple[str, ...]] = {
    "number": ("artnet", "sacn"),
    "host": ("artnet", "sacn"),
    "port": ("artnet", "sacn"),
    "interface": ("artnet", "sacn"),
    "broadcast": ("artnet",),
    "priority": ("sacn",),
    "source_name": ("sacn",),
    "preview": ("sacn",),
    "ttl": ("sacn",),
    "device": ("usb-pro", "open-dmx"),
    "serial": ("usb-pro", "open-dmx", "udmx"),
}


class DmxConfig(Section):
    """One universe of lights on one wire. A universe may leave by several wires."""

    universe: int = key(
        "The universe in the show's fixtures, and its number on the network: artnet 0 to "
        "32767, sacn 1 to 63999."
    )
    wire: WireKind = key(
        "artnet and sacn: over the network; usb-pro: ENTTEC DMX USB Pro and compatible; "
        "open-dmx: a bare FTDI cable, not recommended for shows; udmx: anyma uDMX."
    )
    rate_hz: float | None = key(
        "Universes a second at most; null: 40, open-dmx 30.", None, within=(1, FASTEST_HZ)
    )
    channels: int = key("Number of channels sent, from the first.", SLOTS, within=(24, SLOTS))
    number: int | None = key(
        "artnet (net, subnet and universe in one) and sacn: the number on the network if it "
        "differs from the universe.",
        None,
    )
    host: Ipv4 | None = key(
        "artnet: the node's address, null: this machine; sacn: send only to this address, null: multicast.",
        None,
    )
    port: int | None = key(
        "artnet, sacn: UDP port; null: the usual one (6454, 5568).", None, within=(1, 65535)
    )
    interface: Ipv4 | None = key(
        "artnet, sacn: this machine's own address in the lights' network. null: artnet takes the "
        "route to its host; sacn stays on this machine.",
        None,
    )
    broadcast: bool = key("artnet: host is a broadcast address.", False)
    priority: int = key("sacn: among sources of a universe, higher wins.", 100, within=(0, 200))
    source_name: str = key("sacn: the name of this box on consoles.", "Bunraku", length=(1, 63))
    preview: bool = key("sacn: for visualisers only; lights should ignore it.", False)
    ttl: int = key("sacn: how many networks multicast may reach; 1: this one only.", 1, within=(1, 255))
    device: SerialDevice | None = key(
        "usb-pro, open-dmx: the serial device, like /dev/ttyUSB0.", None, length=(1, 200)
    )
    serial: str | None = key(
        "usb-pro, open-dmx, udmx: the adapter's USB serial number; null: the first one found.",
        None,
        length=(1, 100),
    )

    @model_validator(mode="before")
    @classmethod
    def _keys_of_this_wire(cls, values: Any) -> Any:
        if not isinstance(values, dict) or values.get("wire") not in WIRE_NAMES:
            return values
        for name, wires in _OWN_KEYS.items():
            if name in values and values["wire"] not in wires:
                message = f"'{name}' belongs to {' and '.join(wires)}, and this wire is {values['wire']}."
                raise refusal(message, "Remove it.", at=name)
        return values

    @model_validator(mode="after")
    def _number_exists(self) -> DmxConfig:
        if self.number is not None or self.wire not in NUMBERS:
            _require("A box", 0, LAST_UNIVERSE, "universe", self.universe)
        if self.wire in NUMBERS:
            key = "universe" if self.number is None else "number"
            _require(WIRE_NAMES[self.wire], *NUMBERS[self.wire], key, self.number_on_wire)
        if self.host == "255.255.255.255" and not self.broadcast:
            raise refusal(
                "This address means every machine of the network.",
                "Write the node's own address, or add `broadcast: true`.",
                at="host",
            )
        return self

    @property
    def number_on_wire(self) -> int:
        """Art-Net's port address or sACN's universe."""
        return self.universe if self.number is None else self.number

    @property
    def rate(self) -> float:
        """Universes a second at most."""
        return self.rate_hz or _USUAL_HZ.get(self.wire, 40.0)

    @property
    def udp_port(self) -> int:
        """Where Art-Net or sACN goes to."""
        return self.port or _PORTS[self.wire]

    @property
    def destination(self) -> tuple[object, ...]:
        """The identity that two entries must not share: a light that receives both cannot tell them apart."""
        if self.wire in NUMBERS:
            host = self.host or ("127.0.0.1" if self.wire == "artnet" else "multicast")
            return (self.wire, host, self.udp_port, self.number_on_wire, self.interface)
        if self.device or self.serial:
            return ("usb" if self.wire == "udmx" else "cable", self.device, self.serial)
        return (self.wire,)


def _require(sender: str, low: int, high: int, key: str, number: int) -> None:
    if not low <= number <= high:
        raise refusal(
            f"{sender} has universes from {low} to {high}; {number} is none of them.",
            f"Write a number from {low} to {high}.",
            at=key,
        )


def _each_destination_once(wires: list[DmxConfig]) -> list[DmxConfig]:
    taken = [wire.destination for wire in wires]
    for place, wire in enumerate(wires):
        if wire.destination in taken[:place]:
            first = taken.index(wire.destination)
            raise refusal(
                f"dmx[{first}] and dmx[{place}] send to the same place by {WIRE_NAMES[wire.wire]}.",
                "Remove one, or give it another universe."
                if wire.wire in NUMBERS
                else "Say by device or serial which adapter each of them is.",
                at=place,
            )
    return wires


DmxWires = Annotated[list[DmxConfig], AfterValidator(_each_destination_once)]
