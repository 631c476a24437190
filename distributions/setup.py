"""The version, one for all three distributions, and the box of that version as a requirement."""

import tomllib
from pathlib import Path

from setuptools import setup


def project(file: str) -> dict:
    """A pyproject.toml next to this file."""
    return tomllib.loads((Path(__file__).absolute().parent / file).read_text("utf-8"))


version = project("box.toml")["project"]["version"]
needed = project("pyproject.toml")["tool"]["bunraku"]["dependencies"]
setup(version=version, install_requires=[f"bunraku=={version}", *needed])
