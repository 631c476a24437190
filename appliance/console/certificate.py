"""The box's own certificate for HTTPS: made once by the command openssl, and kept."""

from __future__ import annotations

import hashlib
import ipaddress
import re
import ssl
import subprocess
from collections.abc import Sequence
from pathlib import Path

from appliance.box.durable import write_whole

FILE = "console.pem"
_DAYS = 3650
_PATIENCE_S = 60.0
_CERTIFICATE = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)


def certificate_in(folder: Path, names: Sequence[str]) -> Path:
    """The file with key and certificate; made where there is none. names: addresses and names of the box.

    Raises OSError where it can be neither made nor kept.
    """
    path = folder / FILE
    if path.is_file():
        return path
    own = dict.fromkeys(("localhost", "127.0.0.1", "::1", *names))
    meant = ",".join(f"{'IP' if _is_address(name) else 'DNS'}:{name}" for name in own)
    command = (
        *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"),
        *("-days", str(_DAYS), "-subj", "/CN=Bunraku", "-addext", f"subjectAltName={meant}"),
        *("-keyout", "-", "-out", "-"),
    )
    try:
        made = subprocess.run(command, capture_output=True, timeout=_PATIENCE_S, check=True).stdout
    except (subprocess.SubprocessError, FileNotFoundError) as error:
        raise OSError(0, "openssl did not make a certificate: is the package openssl there?") from error
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_whole(path, made, private=True)
    return path


def fingerprint(path: Path) -> str:
    """SHA-256 of the certificate, as browsers show it. Raises OSError, ValueError."""
    found = _CERTIFICATE.search(path.read_text())
    if found is None:
        raise ValueError("there is no certificate in it")
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(found[0])).digest().hex(":").upper()


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
