"""The box's own certificates for HTTPS, made by the command openssl: an authority's, and the server's."""

from __future__ import annotations

import hashlib
import ipaddress
import re
import ssl
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from aiohttp import web

from appliance.box.durable import private_folder, write_whole

FILE = "console.pem"  # the server's key and certificate, then the authority's certificate
AUTHORITY_FILE = "console-authority.pem"  # what a phone may install signs no other server's name
_AUTHORITY_DAYS = 3650
_DAYS = 397  # Apple's devices trust no server's certificate for longer than 825 days
_RENEWED_DAYS = 30
_DAY_S = 24 * 3600.0
_PATIENCE_S = 60.0
_OWN = ("localhost", "127.0.0.1", "::1")
_PRIVATE = (
    *("127.0.0.0/8", "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16"),
    *("::1/128", "fc00::/7", "fe80::/10"),
)
_CERTIFICATE = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)
_NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


def certificate_in(folder: Path, names: Sequence[str], now: float | None = None) -> Path:
    """The file with key and certificate, made anew where it is missing, lacks a name or is about to expire.

    names: addresses and names of the box. The authority that signs it stays as long as it may sign them.
    now: Unix seconds. Raises OSError where a certificate can be neither made nor kept.
    """
    now = time.time() if now is None else now
    own = list(dict.fromkeys((*_OWN, *(name.split("%")[0].lower() for name in names))))
    path, authority = folder / FILE, folder / AUTHORITY_FILE
    if _covers(path, own, now + _RENEWED_DAYS * _DAY_S):
        return path
    private_folder(folder)
    more = [name for name in own if not _is_private(name)]
    if not _covers(authority, more, now + _DAYS * _DAY_S):
        allowed = [*_PRIVATE, "local", *more]
        permitted = ",".join(f"permitted;{_constraint(one)}" for one in allowed)
        made = _openssl(
            *("req", "-x509", *_NEW_KEY, "-days", str(_AUTHORITY_DAYS), "-subj", "/CN=Bunraku"),
            *("-addext", f"nameConstraints=critical,{permitted}", "-addext", "keyUsage=critical,keyCertSign"),
            *("-keyout", "-", "-out", "-"),
        )
        _keep(authority, made, [name for name in own if name in more], now + _AUTHORITY_DAYS * _DAY_S)
    meant = ",".join(f"{'IP' if _is_address(name) else 'DNS'}:{name}" for name in own)
    wanted = (f"subjectAltName={meant}", "extendedKeyUsage=serverAuth", "basicConstraints=critical,CA:FALSE")
    asked = _openssl(
        *("req", "-new", *_NEW_KEY, "-subj", "/CN=Bunraku box", "-keyout", "-", "-out", "-"),
        *(word for extension in wanted for word in ("-addext", extension)),
    )
    signed = _openssl(
        *("x509", "-req", "-CA", str(authority), "-days", str(_DAYS), "-copy_extensions", "copyall"),
        said=asked,
    )
    key = asked[: asked.index(b"-----BEGIN CERTIFICATE REQUEST-----")]
    _keep(path, key + signed + authority_certificate(folder).encode(), own, now + _DAYS * _DAY_S)
    return path


def authority_certificate(folder: Path) -> str:
    """The certificate that a phone installs to trust this box, as PEM. Raises OSError, ValueError."""
    return _certificates((folder / AUTHORITY_FILE).read_text())[0]


def routes(folder: Path) -> list[web.RouteDef]:
    """Where a device fetches the authority's certificate, to install it."""

    async def serve(request: web.Request) -> web.Response:
        try:
            body = ssl.PEM_cert_to_DER_cert(authority_certificate(folder))
        except (OSError, ValueError):
            raise web.HTTPNotFound(text="This box serves its page without HTTPS: `console: https`.") from None
        headers = {"Content-Disposition": 'attachment; filename="bunraku.crt"'}
        return web.Response(body=body, content_type="application/x-x509-ca-cert", headers=headers)

    return [web.get("/bunraku.crt", serve)]


def _keep(path: Path, made: bytes, names: Sequence[str], until: float) -> None:
    write_whole(path, f"{_reported(names)}{until:.0f}\n".encode() + made, private=True)


def _covers(path: Path, names: Sequence[str], until: float) -> bool:
    """Whether a file of ours has all these names, and is valid until then. Its first line says so."""
    try:
        reported = path.read_text().partition("\n")[0].split()
        return reported[0] == "bunraku" and set(names) <= set(reported[1:-1]) and float(reported[-1]) >= until
    except (OSError, ValueError, IndexError):
        return False


def _reported(names: Sequence[str]) -> str:
    return " ".join(("bunraku", *names, ""))


def _is_private(name: str) -> bool:
    """Whether every authority of ours may sign it."""
    if not _is_address(name):
        return name == "local" or name.endswith(".local")
    address = ipaddress.ip_address(name)
    return any(
        address in network
        for network in map(ipaddress.ip_network, _PRIVATE)
        if network.version == address.version
    )


def _constraint(allowed: str) -> str:
    if "/" in allowed or _is_address(allowed):
        network = ipaddress.ip_network(allowed)
        return f"IP:{network.network_address.exploded}/{network.netmask.exploded}"
    return f"DNS:{allowed}"


def _openssl(*arguments: str, said: bytes = b"") -> bytes:
    try:
        done = subprocess.run(
            ("openssl", *arguments), input=said, capture_output=True, timeout=_PATIENCE_S, check=True
        )
    except (subprocess.SubprocessError, FileNotFoundError) as error:
        raise OSError(0, "openssl did not make a certificate: is the package openssl there?") from error
    return done.stdout


def _certificates(text: str) -> list[str]:
    found = _CERTIFICATE.findall(text)
    if not found:
        raise ValueError("there is no certificate in it")
    return [f"{one}\n" for one in found]


def fingerprint(path: Path) -> str:
    """SHA-256 of the server's certificate, as browsers show it. Raises OSError, ValueError."""
    served = _certificates(path.read_text())[0]
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(served)).digest().hex(":").upper()


def https_context(path: Path) -> ssl.SSLContext:
    """For a server. Raises OSError (ssl.SSLError is one) for a spoilt file."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.load_cert_chain(path)
    return context


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
