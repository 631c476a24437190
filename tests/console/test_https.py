"""The page over HTTPS: the box's own certificate, the same after a restart, its fingerprint at the prompt."""

from __future__ import annotations

import hashlib
import http.client
import json
import re
import socket
import ssl
import time
from pathlib import Path

import pytest
import yaml

from appliance.console.certificate import (
    AUTHORITY_FILE,
    FILE,
    authority_certificate,
    certificate_in,
    fingerprint,
    https_context,
)
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.system.box import playing
from tests.system.namespace import Cable, Namespace, why_not
from tests.system.processes import BUNRAKU, Process, run_bunraku, wait_until

WHY_NOT = why_not()


def served(port: int) -> str:
    """The SHA-256 of the certificate that is served there; empty while there is none."""
    try:
        found = ssl.get_server_certificate((HOST, port))
    except OSError:
        return ""
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(found)).digest().hex(":").upper()


def test_a_box_has_one_certificate_and_the_same_rules_over_https(tmp_path: Path) -> None:
    (port,) = free_ports(1, socket.SOCK_STREAM)
    box_file = tmp_path / "box.yaml"
    console = {"port": port, "https": True, "names": ["bunraku.hall"]}
    kept = {"console": console, "control": None, "runtime": "runtime", "state": "state"}
    box_file.write_text(yaml.safe_dump(kept))
    with Process(tmp_path / "page.txt", [*BUNRAKU, "console", "--box", box_file]) as process:
        first = wait_until(lambda: served(port), lambda: process.output)
        assert f"The page: https://{HOST}:{port}" in process.output
        pin, _, reported = run_bunraku("console", "pin", "--box", box_file).stdout.strip().partition("\n")
        assert reported == f"Certificate, SHA-256: {first}"
        trusted = ssl.create_default_context(cafile=str(tmp_path / "state" / FILE))
        page = http.client.HTTPSConnection(HOST, port, context=trusted, timeout=60)
        said = json.dumps({"pin": pin, "name": "a"})
        page.request("POST", "/api/pin", said, {"Origin": f"https://{HOST}:{port}"})
        answer = page.getresponse()
        assert answer.status == 200 and "Secure" in (answer.headers["Set-Cookie"] or "")
        answer.read()
        page.request("POST", "/api/pin", said, {"Origin": f"http://{HOST}:{port}"})
        assert page.getresponse().status == 403, "a page without HTTPS is another page"
        page.close()
        process.kill()
        process.start()
        assert wait_until(lambda: served(port), lambda: process.output) == first
    assert (tmp_path / "state" / FILE).stat().st_mode & 0o077 == 0


def test_one_command_offers_a_phone_the_page_and_what_makes_it_trusted(tmp_path: Path) -> None:
    """The authority that a phone installs is enough to trust the box, and stays when its address changes."""
    (port,) = free_ports(1, socket.SOCK_STREAM)
    show, console = write_show(tmp_path / "show"), {"port": port, "names": ["bunraku.hall"]}
    with playing(show, tmp_path, "--emulate", "--phone", settings={"console": console}) as box:
        box.await_output("Another phone: bunraku console phone NAME")
        code = re.search(r"https://\S+/phone#left-wrist=(\S+)", box.output)
        assert code is not None and wait_until(lambda: served(port), lambda: box.output)
        anyone = ssl._create_unverified_context()
        unknown = http.client.HTTPSConnection(HOST, port, context=anyone, timeout=60)
        unknown.request("GET", "/bunraku.crt")
        answer = unknown.getresponse()
        assert answer.headers["Content-Type"] == "application/x-x509-ca-cert"
        trusted = ssl.create_default_context(cadata=answer.read())
        unknown.close()
        page = http.client.HTTPSConnection(HOST, port, context=trusted, timeout=60)
        said = json.dumps({"name": "left-wrist", "where": "hand", "code": code[1]})
        for status in (200, 409):
            page.request("POST", "/api/phones/join", said, {"Origin": f"https://{HOST}:{port}"})
            answer = page.getresponse()
            assert answer.status == status, answer.read()
            answer.read()
        page.close()
    first = certificate_in(tmp_path, ["10.0.0.5"])
    authority, before = authority_certificate(tmp_path), fingerprint(first)
    assert fingerprint(certificate_in(tmp_path, [])) == before, "it has all these names already"
    assert fingerprint(certificate_in(tmp_path, ["192.168.7.7"])) != before
    assert authority_certificate(tmp_path) == authority
    certificate_in(tmp_path, ["new.hall"])
    assert authority_certificate(tmp_path) != authority, "it may sign the names of this box only"


@pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))
def test_a_network_that_comes_after_the_page_is_in_its_certificate(tmp_path: Path) -> None:
    """As at power-on, where the router gives the box its address some seconds later."""
    address, port = "10.77.0.1", 8443
    box_file = tmp_path / "box.yaml"
    console = {"host": "0.0.0.0", "port": port, "https": True, "viewers": ["10.77.0.0/24"]}
    kept = {"console": console, "control": None, "runtime": "runtime", "state": "state"}
    box_file.write_text(yaml.safe_dump(kept))

    def trusts() -> bool:
        """As a phone that has installed the box's authority, or another box."""
        trusted = ssl.create_default_context(cafile=str(tmp_path / "state" / AUTHORITY_FILE))
        with socket.create_connection((address, port), 10.0) as plain:
            try:
                trusted.wrap_socket(plain, server_hostname=address).close()
            except ssl.SSLCertVerificationError:
                return False
        return True

    with Namespace("box") as box, Namespace("phone") as phone, box.entered():
        command = [*BUNRAKU, "console", "--box", box_file]
        with Process(tmp_path / "page.txt", command) as process:
            wait_until(lambda: served(port), lambda: process.output)
            anyone = ssl._create_unverified_context()
            with socket.create_connection((HOST, port)) as plain, anyone.wrap_socket(plain):
                Cable(box, f"{address}/24", phone, "10.77.0.2/24")
                time.sleep(12.0)
                assert not trusts(), "a browser that has the page open keeps what it has accepted"
            wait_until(trusts, lambda: process.output, lambda: time.sleep(10.0))


def test_what_cannot_be_used_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OSError, match="is the package openssl there"):
        certificate_in(tmp_path / "state", ())
    (tmp_path / FILE).write_text("spoilt")
    with pytest.raises(ssl.SSLError):
        https_context(tmp_path / FILE)
    with pytest.raises(ValueError, match="no certificate"):
        fingerprint(tmp_path / FILE)
