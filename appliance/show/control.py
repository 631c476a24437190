"""box.yaml's section about show control: where commands arrive, from whom, and where the heartbeat goes."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import AfterValidator, model_validator

from appliance.show.section import Ipv4, Section, key, refusal


def _network(text: str) -> str:
    try:
        return str(ipaddress.IPv4Network(text, strict=False))
    except ValueError:
        raise refusal(
            f"'{text}' is neither an IPv4 address nor a network.",
            "Write an address like 192.168.0.20, or a network like 192.168.0.0/24.",
        ) from None


Senders = Annotated[str, AfterValidator(_network)]


class HeartbeatConfig(Section):
    """A receiver of the box's status, once a second."""

    host: Ipv4 = key("The listener's IP address.", "127.0.0.1")
    port: int = key("The listener's UDP port.", 9003, within=(1, 65535))


class ReplyConfig(Section):
    """A receiver of the box's replies."""

    host: Ipv4 = key("The listener's IP address.", "127.0.0.1")
    port: int = key("The listener's UDP port.", 9001, within=(1, 65535))


class FeedbackConfig(Section):
    """A controller with motor faders or lit buttons."""

    host: Ipv4 = key("The controller's IP address.", "127.0.0.1")
    port: int = key("The UDP port on which it listens.", 9001, within=(1, 65535))


class ControlConfig(Section):
    """Where commands by OSC arrive, and from whom."""

    host: Ipv4 = key("Address to listen on; 0.0.0.0: all networks; only `senders` are heard.", "127.0.0.1")
    port: int = key("UDP port; 0: any free one.", 9002, within=(0, 65535))
    senders: list[Senders] = key(
        "Senders that may command the box: addresses (192.168.0.20) or networks (192.168.0.0/24). "
        "This machine always may; []: no other.",
        [],
        length=(0, 32),
    )
    heartbeat: list[HeartbeatConfig] = key(
        "Receivers of /bunraku/status, once a second; docs/osc.md explains it.", [], length=(0, 16)
    )

    replies: list[ReplyConfig] = key(
        "Receivers of each answer besides the sender of its command: desks often listen on another port than "
        "they send from.",
        [],
        length=(0, 16),
    )

    feedback: list[FeedbackConfig] = key(
        "Controllers that hear where each lever is, at its own address, once another one has moved it, and "
        "all of them every 10 s.",
        [],
        length=(0, 16),
    )

    @model_validator(mode="after")
    def _open_to_a_sender(self) -> ControlConfig:
        if not self.host.startswith("127.") and not self.senders:
            raise refusal(
                f"Commands are heard on {self.host}, but no sender may command the box.",
                "List the senders, like `senders: [192.168.0.20]` or a whole network "
                "`[192.168.0.0/24]`; or listen on 127.0.0.1 for this machine alone.",
                at="host",
            )
        unheard = [sender for sender in self.senders if not sender.startswith("127.")]
        if self.host.startswith("127.") and unheard:
            raise refusal(
                f"{unheard[0].removesuffix('/32')} may command the box, but commands are heard on "
                f"{self.host}: from this machine only.",
                "Write `host: 0.0.0.0` beside `senders`, or this machine's address in that network.",
                at="senders",
            )
        return self
