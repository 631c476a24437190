"""The address by which a phone becomes a sensor, and its QR code."""

from __future__ import annotations

from urllib.parse import quote

import segno

from appliance.box.served import is_loopback, outward_host


def phone_address(origin: str, name: str, code: str) -> str:
    """origin: like https://192.168.0.5:8080. The code stays in the browser: no server is sent a fragment."""
    return f"{origin}/phone#{quote(name, safe='')}={code}"


def address_here(scheme: str, host: str, name: str, code: str) -> str:
    """The same for the Host of a request: a phone does not reach the box as localhost."""
    plain, _, port = host.rpartition(":") if not host.endswith("]") else (host, "", "")
    plain, port = (plain, port) if plain else (host, "")
    if is_loopback(plain):
        plain = outward_host()
    return phone_address(f"{scheme}://{plain}{f':{port}' if port else ''}", name, code)


def squares(address: str) -> list[str]:
    """The QR code, row by row, 1 for dark, with no margin."""
    code = segno.make(address, error="m", micro=False)
    return ["".join("01"[bool(one)] for one in row) for row in code.matrix]
