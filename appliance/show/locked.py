"""box.yaml's section about boxes that dance in step: one leads, the others follow it frame by frame."""

from __future__ import annotations

import ipaddress

from pydantic import field_validator, model_validator

from appliance.show.section import Ipv4, LocalFile, Section, key, refusal, refuse_repeats


class FollowerConfig(Section):
    """A box that dances in step with this one."""

    host: Ipv4 = key("Its address.")
    port: int = key(
        "UDP port, the same in that box's file; another one for each box.", 9761, within=(1024, 65535)
    )


class LockedConfig(Section):
    """Boxes that dance the same frames at the same time, each to its own outputs."""

    leader: Ipv4 | None = key(
        "On a box that follows: the address of the one that leads; null: this one leads.", None
    )
    followers: list[FollowerConfig] = key("On the box that leads: the others.", [], length=(0, 8))
    host: Ipv4 = key("Address to listen on; 0.0.0.0: every network.", "127.0.0.1")
    port: int = key("On a box that follows: UDP port, as the leader lists it.", 9761, within=(1024, 65535))
    secret: LocalFile = key(
        "File with the boxes' secret, the same on all, relative to the box file; `bunraku pair secret` makes "
        "it."
    )

    @field_validator("followers")
    @classmethod
    def _a_port_each(cls, followers: list[FollowerConfig]) -> list[FollowerConfig]:
        ports = [one.port for one in followers]
        refuse_repeats(ports, "Two boxes that follow have the port {value}.", "Give each another one.")
        return followers

    @model_validator(mode="after")
    def _leads_or_follows(self) -> LockedConfig:
        if (self.leader is None) == (not self.followers):
            raise refusal(
                "A box either leads others or follows one.", "Give `leader` or `followers`.", at="leader"
            )
        if _is_inside(self.host) and not all(_is_inside(host) for host, _ in self.ends):
            raise refusal(
                f"The other boxes are in the network, and this one listens on {self.host}, inside itself.",
                "Write `host: 0.0.0.0` under locked.",
                at="host",
            )
        return self

    @property
    def ends(self) -> list[tuple[str, int]]:
        """Address and port of each other box that this one hears."""
        if self.leader is not None:
            return [(self.leader, self.port)]
        return [(one.host, one.port) for one in self.followers]


def _is_inside(host: str) -> bool:
    return ipaddress.IPv4Address(host).is_loopback
