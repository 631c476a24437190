"""Announces the page in the network, by DNS-SD: `python -m appliance.cli.announce --chosen FILE` for avahi.

Writes avahi's file of services: `_bunraku._tcp` for lists of boxes, `_http._tcp` (`_https._tcp`) for
browsers. Where the box file keeps the page on this machine, there is no such file.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from appliance.box.durable import write_whole
from appliance.box.served import is_loopback
from appliance.release.choice import CHOSEN, RUN, box_of
from appliance.show.box import BoxConfig, load_box

SERVICES = Path("/etc/avahi/services/bunraku.service")
TYPE = "_bunraku._tcp"
_GROUP = """\
<?xml version="1.0" standalone="no"?>
<!DOCTYPE service-group SYSTEM "avahi-service.dtd">
<service-group>
  <name replace-wildcards="yes">Bunraku on %h</name>{services}
</service-group>
"""
_SERVICE = """
  <service>
    <type>{type}</type>
    <port>{port}</port>
    <txt-record>version={version}</txt-record>
    <txt-record>scheme={scheme}</txt-record>
  </service>"""


def services(box: BoxConfig) -> str:
    """avahi's file; empty if only this machine can open the page, or if its port is any free one."""
    console = box.console
    if console is None or not console.port or is_loopback(console.host):
        return ""
    scheme = "https" if console.https else "http"
    values = {"port": console.port, "version": version("bunraku"), "scheme": scheme}
    kinds = TYPE, f"_{scheme}._tcp"
    return _GROUP.format(services="".join(_SERVICE.format(type=kind, **values) for kind in kinds))


def announce(box: BoxConfig, path: Path = SERVICES) -> None:
    """Write it, or take it away. Raises OSError."""
    if text := services(box):
        write_whole(path, text.encode())
        path.chmod(0o644)
    else:
        path.unlink(missing_ok=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """For the unit."""
    parser = argparse.ArgumentParser(prog="announce", description="Announce the page in the network.")
    parser.add_argument("--chosen", type=Path, default=RUN / CHOSEN)
    announce(load_box(box_of(None, parser.parse_args(arguments).chosen)))


if __name__ == "__main__":
    main()
