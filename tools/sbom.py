"""Writes the bill of materials of a release as CycloneDX 1.6 (JSON); the same inputs give the same bytes.

    python -m tools.sbom --arch amd64 out/bunraku-0.2.0-amd64.cdx.json
    python -m tools.sbom --arch amd64 --debian build/image/etc/bunraku-packages out/image.cdx.json

It lists the Python packages of an installed box with the hashes of their files (deploy/release/*.lock) and
the parts of the wearable's firmware (sketch.yaml). With --debian it adds the Debian packages of an image:
`deploy/image/mkroot.sh` writes that list.
"""

from __future__ import annotations

import argparse
import json
import re
import tomllib
import uuid
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
_OWN: Component = {"licenses": [{"license": {"id": "MIT"}}]}  # licence of everything that this checkout makes


def main() -> None:
    """Write the file that the arguments name."""
    parser = argparse.ArgumentParser(description="Write a bill of materials (CycloneDX, JSON).")
    parser.add_argument("--arch", choices=ARCHITECTURES, default="amd64", help="processor of the box")
    parser.add_argument("--debian", type=Path, help="list of Debian packages: name, version, size a line")
    parser.add_argument("out", type=Path, help="file to write")
    given = parser.parse_args()
    debian = given.debian.read_text("utf-8") if given.debian else ""
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(bill(given.arch, debian), "utf-8")


def bill(arch: str, debian: str = "", root: Path = ROOT) -> str:
    """The document as text. Raises ValueError for a line of a lock that is no pin."""
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    release = root / "deploy" / "release"
    locks = [release / f"requirements-{arch}.lock", release / f"sources-{arch}.lock"]
    components = [one for lock in locks if lock.is_file() for one in python_packages(lock.read_text("utf-8"))]
    components.append(_component("bunraku-sim", project["version"], "pkg:pypi/bunraku-sim", **_OWN))
    components += firmware_parts((root / "firmware" / "wearable" / "sketch.yaml").read_text("utf-8"))
    components += debian_packages(debian, arch)
    components.sort(key=lambda one: str(one["purl"]))
    own = {
        "type": "application",
        "bom-ref": f"pkg:pypi/{project['name']}@{project['version']}",
        "name": project["name"],
        "version": project["version"],
        "purl": f"pkg:pypi/{project['name']}@{project['version']}",
        **_OWN,
    }
    content = json.dumps([own, components], sort_keys=True)
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(NAMESPACE, content)}",
        "version": 1,
        "metadata": {"component": own, "properties": [{"name": "bunraku:architecture", "value": arch}]},
        "components": components,
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
        hashes = [{"alg": "SHA-256", "content": pin["sha256"]}]
        found.append(_component(name, pin["version"], f"pkg:pypi/{name}", hashes=hashes))
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


def _component(name: str, version: str, purl: str, query: str = "", **more: Any) -> Component:
    reference = f"{purl}@{version}{query}"
    return {
        "type": "library",
        "bom-ref": reference,
        "name": name,
        "version": version,
        "purl": reference,
        **more,
    }


if __name__ == "__main__":
    main()
