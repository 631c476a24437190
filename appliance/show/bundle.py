"""A show bundle as a folder of files: where those that come with the box lie, and checksums."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

from appliance.pose.foreign_file import content, opened, require_inside
from appliance.pose.whole_file import write_text_whole
from appliance.show.config_error import Problem, nearest

CHECKSUMS = "SHA256SUMS"
SIGNATURE = f"{CHECKSUMS}.sig"  # `ssh-keygen -Y sign` writes it over the checksums
WORKSHOP = ("checkpoint.pt", "training.json", "pictures")  # left there by a training: no part of the show
LARGEST_FILE = 400_000_000  # bytes; a network has some 3 MB, a phrase some 5
MOST_FILES = 4000
LARGEST_CHECKSUMS = 1 << 20
_DEFAULT, _BUNDLED = "default", "_show"
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)")
COPY_AGAIN = "Copy the whole bundle again."


def bundled_shows() -> dict[str, Path]:
    """The bundles that come with the box, by name, in the folders `NAME_show` next to this file.

    The default is the first.
    """
    shows = {
        path.name.removesuffix(_BUNDLED): path for path in default_show_path().parent.glob(f"*{_BUNDLED}")
    }
    return {name: shows[name] for name in sorted(shows, key=lambda name: (name != _DEFAULT, name))}


def default_show_path() -> Path:
    """The bundle that is danced where no other is named."""
    return Path(__file__).resolve().parent / f"{_DEFAULT}{_BUNDLED}"


def named_show(show: Path | None) -> Path | None:
    """The folder of a bundled show that is given by its name; any other path as it is.

    A show in a folder of this name takes precedence.
    """
    if show is None or (show / "show.yaml").is_file():
        return show
    return bundled_shows().get(str(show), show)


def no_such_show(directory: Path) -> Problem:
    """A show folder that does not exist, and the bundled show that was probably meant."""
    names = list(bundled_shows())
    near = nearest(directory, names) if len(directory.parts) == 1 else None
    known = f"Shows that come with the box: {', '.join(names)}."
    cure = f"Did you mean '{near}', which comes with the box?" if near else f"Check its path. {known}"
    return Problem(directory, 0, "There is no such show folder.", cure)


def bundle_files(directory: Path) -> list[str]:
    """Names of all files of a show, relative to it, sorted; without checksums, hidden and training files.

    Links, FIFOs and devices are named too: what opens them refuses them. Raises OSError for too many.
    """
    names: list[str] = []
    for folder, folders, files in os.walk(directory):
        inside = Path(folder).relative_to(directory)
        own = WORKSHOP if folder == str(directory) else ()
        folders[:] = [name for name in folders if not name.startswith(".") and name not in own]
        links = [name for name in folders if (Path(folder) / name).is_symlink()]
        names += [
            (inside / name).as_posix()
            for name in (*files, *links)
            if not name.startswith(".") and name not in own
        ]
        if len(names) > MOST_FILES:
            raise OSError(errno.E2BIG, f"it has more than {MOST_FILES} files", str(directory))
    return sorted(name for name in names if name not in (CHECKSUMS, SIGNATURE))


def require_file(directory: Path, name: str) -> None:
    """Raises OSError for a file that cannot be part of a show: too large, not regular, or outside of it."""
    require_inside(directory / name, directory)
    with opened(directory / name) as stream:
        if os.fstat(stream.fileno()).st_size > LARGEST_FILE:
            raise OSError(errno.EFBIG, f"it is larger than {LARGEST_FILE // 1_000_000} MB", name)


def bundle_bytes(directory: Path) -> int:
    """Size of all its files together. Raises OSError as bundle_files does."""
    return sum((directory / name).lstat().st_size for name in bundle_files(directory))


def write_checksums(directory: Path) -> None:
    """Write SHA256SUMS over all files of the bundle, in the form that `sha256sum --check` reads.

    Raises OSError where one of them cannot be part of a show.
    """
    lines = [f"{_sha256(directory, name)}  {name}\n" for name in bundle_files(directory)]
    write_text_whole(directory / CHECKSUMS, "".join(lines))


def checksum_problems(directory: Path) -> list[Problem]:
    """Files that changed, are gone, or cannot be read, each with its line in SHA256SUMS."""
    path = directory / CHECKSUMS
    try:
        lines = _checksum_lines(directory)
    except (OSError, UnicodeDecodeError):
        return [Problem(path, 0, "The checksums are missing or unreadable.", COPY_AGAIN)]
    return [
        Problem(path, number, message, cure)
        for number, line in enumerate(lines, 1)
        for message, cure in _line_problems(directory, line)
    ]


def unlisted_files(directory: Path) -> list[str]:
    """Files of the bundle that SHA256SUMS does not vouch for; none where it cannot be read.

    Raises OSError as bundle_files does.
    """
    try:
        lines = _checksum_lines(directory)
    except (OSError, UnicodeDecodeError):
        return []
    listed = {found[2] for line in lines if (found := _LINE.fullmatch(line))}
    return [name for name in bundle_files(directory) if name not in listed]


def _line_problems(directory: Path, line: str) -> Iterator[tuple[str, str]]:
    """Message and cure of what is wrong with one line, if anything is."""
    found = _LINE.fullmatch(line)
    if not found or ".." in Path(found[2]).parts or Path(found[2]).is_absolute():
        yield "This is not a checksum and a file's name.", COPY_AGAIN
        return
    name = found[2]
    try:
        if _sha256(directory, name) != found[1]:
            changed = f"'{name}' is not the file that was packed: it is damaged or was changed."
            yield changed, "Copy or export the bundle again, or pack it again if you changed it."
    except FileNotFoundError:
        yield f"'{name}' is missing.", COPY_AGAIN
    except OSError as error:
        yield f"'{name}' cannot be read ({error.strerror}).", COPY_AGAIN


def _checksum_lines(directory: Path) -> list[str]:
    require_inside(directory / CHECKSUMS, directory)
    return content(directory / CHECKSUMS, LARGEST_CHECKSUMS).decode().splitlines()


def _sha256(directory: Path, name: str) -> str:
    require_file(directory, name)
    with opened(directory / name) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
