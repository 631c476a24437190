"""The bill of materials names each pinned package once, with its hash, and names no host."""

from __future__ import annotations

import json

import pytest

from tests.conftest import ROOT
from tools import sbom

HASH = "a" * 64


@pytest.mark.parametrize("arch", sbom.ARCHITECTURES)
def test_every_pin_of_the_box_is_in_the_bill_with_its_hash(arch: str) -> None:
    document = json.loads(sbom.bill(arch))
    hashes = {
        one["hashes"][0]["content"]: one
        for one in document["components"]
        if one["purl"].startswith("pkg:pypi/") and one["name"] != "bunraku-sim"
    }
    locks = sorted((ROOT / "deploy/release").glob(f"*-{arch}.lock"))
    pinned = [
        line.split("sha256:")[1] for lock in locks for line in lock.read_text().splitlines() if "==" in line
    ]
    assert sorted(hashes) == sorted(pinned)
    assert len(pinned) > 20
    references = [one["bom-ref"] for one in document["components"]]
    assert len(set(references)) == len(references)


def test_the_bill_names_the_project_the_firmware_and_debian_packages() -> None:
    document = json.loads(sbom.bill("amd64", "libc6 2.41-12 13000\nbash 5.2 7000\n"))
    purls = {one["purl"] for one in document["components"]}
    assert {"pkg:deb/debian/bash@5.2?arch=amd64", "pkg:deb/debian/libc6@2.41-12?arch=amd64"} <= purls
    assert any(purl.startswith("pkg:generic/WiFi101@") for purl in purls)
    own = document["metadata"]["component"]
    assert own["name"] == "bunraku"
    assert f"pkg:pypi/bunraku-sim@{own['version']}" in purls
    assert document["bomFormat"] == "CycloneDX"


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
