"""Saves a rehearsal: a copy of the show with more cues, as a folder for the box's stick."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from appliance.box.durable import write_whole
from appliance.pose.counted import counted
from appliance.release.arrivals import SHOW
from appliance.release.packed_show import pack_show
from appliance.show.bundle import CHECKSUMS, write_checksums
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show.yaml_edit import with_cue

ZIP = "show.zip"
_OF = "of"  # which show.yaml the copy was made of


def keep_cue(show: Path, folder: Path, cue: Mapping[str, Any]) -> str:
    """Write a cue into the copy of a show in `folder`, and pack it; a sentence for people.

    The copy is begun anew for another show. The show that dances stays as it is. Raises ConfigError for a cue
    that the show refuses, OSError where the folder takes no files; then the copy is as it was.
    """
    begun, copy = folder / _OF, folder / SHOW
    digest = hashlib.sha256((show / "show.yaml").read_bytes()).hexdigest()
    if not begun.is_file() or begun.read_text() != digest:
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(show, copy, ignore=shutil.ignore_patterns(".*"))
        write_whole(begun, digest.encode())
    file = copy / "show.yaml"
    before = {one: one.read_bytes() if one.is_file() else None for one in (file, copy / CHECKSUMS)}
    try:
        text = with_cue(file.read_text(encoding="utf-8"), cue)
        write_whole(file, text.encode())  # whole: a full disk must not take the cues that are there
        config = load_show(copy).config
        write_checksums(copy)
        pack_show(copy, folder / ZIP)
    except (ConfigError, yaml.YAMLError, ValueError, OSError):
        for path, content in before.items():
            _restore(path, content)
        raise
    return (
        f"The cue {cue['name']} is in the copy of the show, which has {counted(len(config.cues), 'cue')} now."
    )


def _restore(path: Path, content: bytes | None) -> None:
    """None: there was no such file. One that did not change is not written: the disk may be full."""
    if content is None:
        path.unlink(missing_ok=True)
    elif path.read_bytes() != content:
        write_whole(path, content)
