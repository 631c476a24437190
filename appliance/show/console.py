"""box.yaml's section about the page: where browsers find it, and from which networks they may look."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import AfterValidator, model_validator

from appliance.show.report import ReportConfig
from appliance.show.section import LocalFile, Section, key, refusal


def _address(text: str) -> str:
    if text == "localhost":
        return "127.0.0.1"
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        raise refusal(
            f"'{text}' is not an address in numbers.",
            "Write 127.0.0.1 (only this machine), '::' (every network) or one address of this machine.",
        ) from None


def _network(text: str) -> str:
    try:
        return str(ipaddress.ip_network(text, strict=False))
    except ValueError:
        raise refusal(
            f"'{text}' is neither an address nor a network.",
            "Write an address like 192.168.0.20, or a network like 192.168.0.0/24 or fd00::/8.",
        ) from None


Host = Annotated[str, AfterValidator(_address)]
Viewers = Annotated[str, AfterValidator(_network)]


class ConsoleConfig(Section):
    """The page for technicians, in any browser."""

    host: Host = key(
        "Address to listen on; '::': all networks, IPv4 and IPv6; only `viewers` are served.",
        "127.0.0.1",
    )
    port: int = key("TCP port; 0: any free one.", 8080, within=(0, 65535))
    viewers: list[Viewers] = key(
        "Devices that may open the page: addresses or networks, IPv4 and IPv6. This machine always may. To "
        "change anything a device needs the PIN as well.",
        [],
        length=(0, 32),
    )
    names: list[str] = key(
        "More names by which browsers reach the page besides addresses, localhost and this machine's name.",
        [],
        length=(0, 8),
    )

    https: bool = key(
        "Serve the page over HTTPS, with the box's own certificate; `bunraku console pin` shows its "
        "fingerprint, which a browser asks about once.",
        False,
    )
    rehearsal: bool = key(
        "Show the page Rehearsal (phrase, iterations, hands); false: a venue that plays the show as it is.",
        True,
    )

    show_keys: LocalFile | None = key(
        "File with public keys, one a line: a show that another box sends has to be signed (`ssh-keygen -Y`) "
        "with one of them. null: the PIN is enough.",
        None,
    )

    report: ReportConfig | None = key(
        "Reports to a technician far away, by a webhook or by mail; null: none.", None
    )

    @model_validator(mode="after")
    def _open_to_a_viewer(self) -> ConsoleConfig:
        if not ipaddress.ip_address(self.host).is_loopback and not self.viewers:
            raise refusal(
                f"The page is served on {self.host}, but no device may open it.",
                "List those that may, like `viewers: [192.168.0.0/24]`; or serve it on 127.0.0.1 for this "
                "machine alone.",
                at="host",
            )
        return self
