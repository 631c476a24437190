"""box.yaml's section about the picture as a stream: where media servers, mixers and browsers fetch it."""

from __future__ import annotations

import ipaddress

from pydantic import model_validator

from appliance.show.console import Host, Viewers
from appliance.show.section import Section, key, refusal


class StreamConfig(Section):
    """The projector's picture as MJPEG over HTTP, for media servers, mixers and browsers."""

    host: Host = key("Address to listen on; '::': all networks; only `viewers` are served.", "127.0.0.1")
    port: int = key("TCP port.", 8090, within=(1, 65535))
    viewers: list[Viewers] = key(
        "Devices that may fetch it: addresses or networks. This machine always may.", [], length=(0, 32)
    )
    names: list[str] = key(
        "Names by which programs reach it, beside addresses, localhost and this machine's own name.",
        [],
        length=(0, 8),
    )
    rate: float = key("Pictures a second at most.", 25.0, within=(1, 60))
    ndi: str | None = key(
        "Name under which NDI programs see it, where NDI's library (libndi) is installed; null: not by NDI.",
        None,
        length=(1, 64),
    )
    ndi_alpha: bool = key("NDI pictures have alpha, as much as a pixel shines.", False)
    quality: int = key("Quality of the JPEGs: more is finer and larger.", 85, within=(10, 100))

    @model_validator(mode="after")
    def _open_to_a_viewer(self) -> StreamConfig:
        if not ipaddress.ip_address(self.host).is_loopback and not self.viewers:
            raise refusal(
                f"The stream is served on {self.host}, but no device may fetch it.",
                "List those that may, like `viewers: [192.168.0.0/24]`; or serve it on 127.0.0.1.",
                at="host",
            )
        return self
