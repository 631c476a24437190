"""The bill of materials names each pinned package once, with its hash, and names no host."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT
from tools import sbom

HASH = "a" * 64


@pytest.mark.parametrize("arch", sbom.ARCHITECTURES)
def test_every_pin_of_the_box_is_in_the_bill_with_its_hash(arch: str) -> None:
    document = json.loads(sbom.bill(arch))
    hashes = {
        one["checksums"][0]["checksumValue"]: one
        for one in document["packages"]
        if purl(one).startswith("pkg:pypi/") and not one["name"].startswith("bunraku")
    }
    locks = sorted((ROOT / "deploy/release").glob(f"*-{arch}.lock"))
    pinned = [
        line.split("sha256:")[1] for lock in locks for line in lock.read_text().splitlines() if "==" in line
    ]
    assert sorted(hashes) == sorted(pinned)
    assert len(pinned) > 20
    references = [one["SPDXID"] for one in document["packages"]]
    assert len(set(references)) == len(references)
    assert {one["relatedSpdxElement"] for one in document["relationships"]} == set(references)


def purl(package: dict[str, Any]) -> str:
    return str(package["externalRefs"][0]["referenceLocator"])


def test_the_bill_names_its_download_by_its_hash(tmp_path: Path) -> None:
    deb = tmp_path / "bunraku_1_amd64.deb"
    deb.write_bytes(b"a package")
    document = json.loads(sbom.bill("amd64", of=deb))
    own = document["packages"][0]
    assert document["name"] == own["packageFileName"] == deb.name
    assert own["checksums"][0]["checksumValue"] == hashlib.sha256(b"a package").hexdigest()


def test_the_bill_names_the_project_the_firmware_and_debian_packages() -> None:
    document = json.loads(sbom.bill("amd64", "libc6 2.41-12 13000\nbash 5.2 7000\n"))
    purls = {purl(one) for one in document["packages"]}
    assert {"pkg:deb/debian/bash@5.2?arch=amd64", "pkg:deb/debian/libc6@2.41-12?arch=amd64"} <= purls
    assert any(purl.startswith("pkg:generic/WiFi101@") for purl in purls)
    own = document["packages"][0]
    assert own["name"] == "bunraku"
    assert f"pkg:pypi/bunraku-sim@{own['versionInfo']}" in purls
    assert document["spdxVersion"] == "SPDX-2.3"


def test_the_same_inputs_give_the_same_bytes_and_no_host() -> None:
    assert sbom.bill("arm64") == sbom.bill("arm64") != sbom.bill("amd64")
    assert "://" not in sbom.bill("amd64")


@pytest.mark.parametrize(
    "line", ["numpy", "numpy==2.0", f"numpy>=2 --hash=sha256:{HASH}", "numpy==2 --hash=md5:0"]
)
def test_a_line_that_is_no_pin_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match="no pinned package"):
        sbom.python_packages(f"# a lock\n{line}\n")


def test_a_part_of_the_firmware_without_a_version_is_refused() -> None:
    with pytest.raises(ValueError, match="no version"):
        sbom.firmware_parts("profiles: {one: {platforms: [{platform: arduino:samd}]}}")
