"""box.yaml's section about the pair: the other box, and which of the two begins."""

from __future__ import annotations

import ipaddress
from typing import Literal

from pydantic import field_validator, model_validator

from appliance.show.section import Ipv4, LocalFile, Section, key, refusal, refuse_repeats


class PairConfig(Section):
    """Two boxes for one show: the second follows the first, and takes over when it is silent."""

    role: Literal["first", "second"] = key("Which box leads when both are switched on; one of each.")
    peer: list[Ipv4] = key(
        "The other box's addresses. The first one in the network of the outputs; a cable between the boxes "
        "may be the second.",
        length=(1, 2),
    )
    host: Ipv4 = key(
        "Address to listen on; 0.0.0.0: every network. Both addresses of the peer need that.", "127.0.0.1"
    )
    port: int = key("UDP port, the same on both boxes.", 9760, within=(1024, 65535))
    secret: LocalFile = key(
        "File with the pair's secret, the same on both boxes, relative to the box file; "
        "`bunraku pair secret` makes it."
    )
    silent_ms: float = key(
        "Time from the deadline of the leader's newest frame until the other box takes over. A larger value "
        "loses more frames; with a smaller one, a short delay of the leader costs it the lead.",
        48.0,
        within=(40, 500),
    )
    priority: int = key(
        "How much above its `priority` a box sends sACN once it has taken over: receivers take its levels "
        "at once.",
        1,
        within=(0, 50),
    )
    picture: Literal["dance", "black"] = key(
        "The picture of the box that follows: the same dance, or black (both projectors on "
        "one wall, without a switch).",
        "dance",
    )

    @field_validator("peer")
    @classmethod
    def _each_once(cls, peer: list[str]) -> list[str]:
        refuse_repeats(peer, "The peer's address {value} is listed twice.", "Remove one.")
        return peer

    @model_validator(mode="after")
    def _listens_where_it_speaks(self) -> PairConfig:
        listens = ipaddress.IPv4Address(self.host)
        if listens.is_loopback and not all(ipaddress.IPv4Address(one).is_loopback for one in self.peer):
            raise refusal(
                f"The other box is in the network, and this one listens on {self.host}, inside itself.",
                "Write `host: 0.0.0.0` under pair.",
                at="host",
            )
        return self
