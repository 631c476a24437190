"""How the picture lies on the wall, and the file that keeps it from night to night."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from appliance.box.durable import private_folder, write_whole
from appliance.pose.foreign_file import TooLargeError, content
from appliance.pose.foreign_yaml import plain_values
from appliance.projector.corners import WHOLE, Corners, complaint
from appliance.projector.warp import NOT_WARPED, Warp
from appliance.projector.warp import complaint as warp_complaint
from appliance.show.box import BoxConfig
from appliance.show.projector import LEAST_TO_MOST_GAMMA, LEAST_TO_MOST_OVERLAP, ProjectorConfig

_log = logging.getLogger(__name__)

_HEADER = (
    "# How the picture lies on the wall; written by bunraku project, corners clockwise from the top left.\n"
)
_LARGEST_FILE = 4096
LAST_WRITE_S = 1.0  # seconds, less than the 3 s that systemd and `bunraku play` give the projector
MOST_BRIGHT = 2.0
_ALSO_IN_BOX_FILE = "mirror", "brightness", "overlap", "blend_gamma"


@dataclass(frozen=True)
class Alignment:
    """corners: where the picture's corners lie, clockwise from its top left as the audience sees it, in
    shares of the display's width and height, y down; mirror: for rear projection; brightness: a factor;
    warp: how far each point of the mesh is pulled from there, row by row, () for none; overlap: the share of
    the display that the projector beside it lights too, 0 where there is none; blend_gamma: this projector's.
    """

    corners: Corners = WHOLE
    mirror: bool = False
    brightness: float = 1.0
    warp: Warp = NOT_WARPED
    overlap: float = 0.0
    blend_gamma: float = 2.2

    @staticmethod
    def of_box(config: ProjectorConfig) -> Alignment:
        """The box file's values."""
        chosen = Alignment(WHOLE, config.mirror, config.brightness)
        blend = config.edge_blend
        return chosen if blend is None else replace(chosen, overlap=blend.overlap, blend_gamma=blend.gamma)


def alignment_folder(box: BoxConfig, environment: Mapping[str, str] = os.environ) -> Path:
    """Where the alignment is kept: the box's state folder, else beside the box file, else with the user."""
    if box.state_folder is not None:
        return box.state_folder
    if box.path is not None:
        return box.path.resolve().parent
    return Path(environment.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "bunraku"


def file_name(config: ProjectorConfig) -> str:
    """Two projectors side by side on one box have a file each."""
    side = "" if config.edge_blend is None else f"-{config.edge_blend.part}"
    return f"projector{side}.alignment"


class AlignmentFile:
    """Keeps an alignment in a file. Its own thread replaces the file as a whole: pictures never wait.

    A value chosen by hand overrides the box file until that value changes there. Nothing here raises: an
    error is reported in one sentence, and the alignment then holds for this run alone.
    """

    def __init__(self, folder: Path, config: ProjectorConfig) -> None:
        self.path = folder / file_name(config)
        self._from_box = Alignment.of_box(config)
        self._saved = self._wanted = self._load()
        self._is_wanted = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._write_changes, name="alignment", daemon=True)
        self._thread.start()

    @property
    def alignment(self) -> Alignment:
        """The newest one, kept or on its way."""
        return self._wanted

    def overrides(self) -> list[str]:
        """A sentence for each value chosen by hand that overrides the box file."""
        chosen, box_file = self._wanted, self._from_box
        sentences = []
        if chosen.corners != WHOLE:
            sentences.append("The corners lie as they were last put by hand.")
        if chosen.warp:
            sentences.append("The picture is warped as it was last warped by hand.")
        if chosen.mirror != box_file.mirror:
            facing = "mirrored" if chosen.mirror else "not mirrored"
            sentences.append(f"The picture is {facing}, as last chosen by hand, against the box file.")
        if chosen.brightness != box_file.brightness:
            sentences.append(
                f"The brightness is {chosen.brightness:g}, as last chosen by hand, and not the box file's "
                f"{box_file.brightness:g}."
            )
        if (chosen.overlap, chosen.blend_gamma) != (box_file.overlap, box_file.blend_gamma):
            sentences.append(
                f"The overlap is {100 * chosen.overlap:.1f} % and its gamma {chosen.blend_gamma:g}, as last "
                f"chosen by hand, and not the box file's {100 * box_file.overlap:.1f} % and "
                f"{box_file.blend_gamma:g}."
            )
        return sentences

    def keep(self, alignment: Alignment) -> None:
        """Have the thread write this one."""
        self._wanted = alignment
        self._is_wanted.set()

    def close(self) -> None:
        """Write what is still pending, within LAST_WRITE_S: a dead disk must not delay the end."""
        self._closing = True
        self._is_wanted.set()
        self._thread.join(LAST_WRITE_S)
        if self._thread.is_alive():
            _log.warning(
                f"{self.path}: the disk does not answer, and the newest alignment is perhaps not kept: after "
                "the next start the picture may lie as before. Look at the disk: bunraku doctor."
            )

    def _write_changes(self) -> None:
        while True:
            self._is_wanted.wait()
            self._is_wanted.clear()
            is_last, wanted = self._closing, self._wanted
            if wanted != self._saved and self._write(wanted):
                self._saved = wanted
            if is_last:
                return

    def _write(self, alignment: Alignment) -> bool:
        try:
            private_folder(self.path.parent)
            write_whole(self.path, _text(alignment, self._from_box).encode(), private=True)
        except OSError as error:
            _log.warning(
                f"{self.path}: the alignment cannot be kept ({error.strerror}). The picture lies as you put "
                "it until the projector ends. Make the folder writable, or name another one under `state` in "
                "the box file."
            )
            return False
        return True

    def _load(self) -> Alignment:
        try:
            return _read(plain_values(content(self.path, _LARGEST_FILE).decode()), self._from_box)
        except (FileNotFoundError, NotADirectoryError):
            return self._from_box
        except (
            TooLargeError,
            ValueError,
            TypeError,
            KeyError,
            OverflowError,
            RecursionError,
            yaml.YAMLError,
        ):
            broken = self.path.with_name(self.path.name + ".broken")
            with contextlib.suppress(OSError):
                self.path.replace(broken)
            _log.warning(
                f"{self.path}: the alignment is damaged and set aside as {broken.name}. The picture fills "
                "the display. Lay it onto the wall again: key c."
            )
        except OSError as error:
            _log.warning(
                f"{self.path}: the alignment cannot be read ({error.strerror}). The picture fills the "
                "display. Check the rights of this file."
            )
        return self._from_box


def _text(alignment: Alignment, from_box: Alignment) -> str:
    """Beside each value that the box file sets as well stands the box file's value of that time."""
    corners = ", ".join(f"[{x!r}, {y!r}]" for x, y in alignment.corners)
    warp = ", ".join(f"[{x!r}, {y!r}]" for x, y in alignment.warp)
    both = "".join(
        f"{name}: {{chosen: {_yaml(getattr(alignment, name))}, box_file: {_yaml(getattr(from_box, name))}}}\n"
        for name in _ALSO_IN_BOX_FILE
    )
    return f"{_HEADER}corners: [{corners}]\nwarp: [{warp}]\n{both}"


def _yaml(value: bool | float) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _read(values: Any, from_box: Alignment) -> Alignment:
    """Raises ValueError, TypeError, KeyError or OverflowError for nonsense."""
    a, b, c, d = ((float(x), float(y)) for x, y in values["corners"])
    warp = tuple((float(x), float(y)) for x, y in values.get("warp", ()))
    chosen = replace(from_box, corners=(a, b, c, d), warp=warp)
    for name in _ALSO_IN_BOX_FILE:
        kept, in_box = values.get(name), getattr(from_box, name)
        if kept is not None and kept["box_file"] == in_box:
            chosen = replace(chosen, **{name: type(in_box)(kept["chosen"])})
    if (
        complaint(chosen.corners)
        or warp_complaint(chosen.warp, chosen.corners)
        or not 0.0 <= chosen.brightness <= MOST_BRIGHT
        or not 0.0 <= chosen.overlap <= LEAST_TO_MOST_OVERLAP[1]
        or not LEAST_TO_MOST_GAMMA[0] <= chosen.blend_gamma <= LEAST_TO_MOST_GAMMA[1]
    ):
        raise ValueError("no alignment")
    return chosen
