"""box.yaml's section about show control: where commands by OSC arrive."""

from __future__ import annotations

from pydantic import Field

from appliance.show.section import Ipv4, Section


class ControlConfig(Section):
    """Where commands by OSC arrive."""

    host: Ipv4 = Field(
        default="127.0.0.1", description="Address to listen on; 0.0.0.0 lets the whole network command."
    )
    port: int = Field(default=9002, ge=0, le=65535, description="UDP port; 0 takes any free one.")
