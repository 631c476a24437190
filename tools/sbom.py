"""Writes the bill of materials of a download as SPDX 2.3 (JSON); the same inputs give the same bytes.

    python -m tools.sbom --arch amd64 --of out/bunraku_0.2.0_amd64.deb out/bunraku_0.2.0_amd64.deb.spdx.json
    python -m tools.sbom --arch arm64 --of out/bunraku-arm64.img.xz --debian out/bunraku-arm64.packages \\
        out/bunraku-arm64.img.spdx.json

It lists the Python packages of an installed box with the hashes of their files (deploy/release/*.lock) and
the parts of the wearable's firmware (sketch.yaml). With --debian it adds the Debian packages of an image:
`deploy/image/mkroot.sh` writes that list.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import tomllib
import uuid
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
ARCHITECTURES = ("amd64", "arm64")
NAMESPACE = uuid.UUID(
    "6fe0d0a9-7a5d-4f0d-9d0c-0d5f3a5a7a11"
)  # namespace of serial numbers: a document names its content
PIN = re.compile(r"(?P<name>[\w.-]+)==(?P<version>\S+) --hash=sha256:(?P<sha256>[0-9a-f]{64})")
PLATFORM = re.compile(r"(?P<name>\S+) \((?P<version>[\d.]+)\)")

Component = dict[str, Any]
_LICENCE = "MIT"  # the licence of this checkout
_NOT_SAID = "NOASSERTION"


def main() -> None:
    """Write the file that the arguments name."""
    parser = argparse.ArgumentParser(description="Write a bill of materials (SPDX, JSON).")
    parser.add_argument("--arch", choices=ARCHITECTURES, default="amd64", help="processor of the box")
    parser.add_argument("--of", type=Path, help="the download that it describes: its name and hash")
    parser.add_argument("--debian", type=Path, help="list of Debian packages: name, version, size a line")
    parser.add_argument("out", type=Path, help="file to write")
    given = parser.parse_args()
    debian = given.debian.read_text("utf-8") if given.debian else ""
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(bill(given.arch, debian, of=given.of), "utf-8")


def bill(arch: str, debian: str = "", root: Path = ROOT, of: Path | None = None) -> str:
    """The document as text. Raises ValueError for a line of a lock that is no pin."""
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    version = project["version"]
    release = root / "deploy" / "release"
    components = python_packages((release / f"requirements-{arch}.lock").read_text("utf-8"))
    components.append(_component("bunraku-sim", version, "pkg:pypi/bunraku-sim", licence=_LICENCE))
    components += firmware_parts((root / "firmware" / "wearable" / "sketch.yaml").read_text("utf-8"))
    components += debian_packages(debian, arch)
    components.sort(key=_purl)
    own = _component("bunraku", version, "pkg:pypi/bunraku", licence=_LICENCE)
    if of is not None:
        with of.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        own |= {"packageFileName": of.name, "checksums": [_sha256(digest)]}
    packages = [own, *components]
    for number, one in enumerate(packages):
        one["SPDXID"] = f"SPDXRef-{number}"
    content = json.dumps([arch, packages], sort_keys=True)
    created = datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", "0")), UTC)
    document = {
        "spdxVersion": "SPDX-2.3",
        "SPDXID": "SPDXRef-DOCUMENT",
        "dataLicense": "CC0-1.0",
        "name": of.name if of is not None else f"bunraku-{version}-{arch}",
        "documentNamespace": f"urn:uuid:{uuid.uuid5(NAMESPACE, content)}",
        "creationInfo": {"created": f"{created:%Y-%m-%dT%H:%M:%SZ}", "creators": ["Tool: bunraku-sbom"]},
        "packages": packages,
        "relationships": [
            _relationship("SPDXRef-DOCUMENT", "DESCRIBES", own),
            *(_relationship(own["SPDXID"], "CONTAINS", one) for one in components),
        ],
    }
    return json.dumps(document, indent=1) + "\n"


def python_packages(lock: str) -> list[Component]:
    """The pins of one lock file. Raises ValueError for a line that is no pin."""
    found = []
    for line in lock.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        pin = PIN.fullmatch(line)
        if pin is None:
            raise ValueError(f"'{line}' is no pinned package with its hash.")
        name = re.sub(r"[-_.]+", "-", pin["name"]).lower()
        component = _component(name, pin["version"], f"pkg:pypi/{name}")
        found.append(component | {"checksums": [_sha256(pin["sha256"])]})
    return found


def firmware_parts(sketch: str) -> list[Component]:
    """Arduino cores and libraries of all profiles, each once. Raises ValueError for one without a version."""
    found: list[Component] = []
    for profile in yaml.safe_load(sketch)["profiles"].values():
        named = [one["platform"] for one in profile["platforms"]] + profile.get("libraries", [])
        for text in named:
            part = PLATFORM.fullmatch(text)
            if part is None:
                raise ValueError(f"'{text}' in sketch.yaml has no version.")
            component = _component(part["name"], part["version"], f"pkg:generic/{part['name']}")
            if component not in found:
                found.append(component)
    return found


def debian_packages(listed: str, arch: str) -> list[Component]:
    """Debian packages of an image, one a line: name, version, and what follows is left out."""
    rows = [line.split() for line in listed.splitlines() if line.strip()]
    return [
        _component(name, version, f"pkg:deb/debian/{name}", f"?arch={arch}") for name, version, *_ in rows
    ]


def _component(name: str, version: str, purl: str, query: str = "", licence: str = _NOT_SAID) -> Component:
    locator = f"{purl}@{version}{query}"
    return {
        "name": name,
        "versionInfo": version,
        "downloadLocation": _NOT_SAID,
        "filesAnalyzed": False,
        "licenseConcluded": licence,
        "licenseDeclared": licence,
        "copyrightText": _NOT_SAID,
        "externalRefs": [
            {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": locator}
        ],
    }


def _purl(component: Component) -> str:
    return str(component["externalRefs"][0]["referenceLocator"])


def _sha256(digest: str) -> dict[str, str]:
    return {"algorithm": "SHA256", "checksumValue": digest}


def _relationship(of: str, kind: str, component: Component) -> dict[str, str]:
    return {"spdxElementId": of, "relationshipType": kind, "relatedSpdxElement": component["SPDXID"]}


if __name__ == "__main__":
    main()
