"""A show as one zip file, in the layout of a stick; and whether the maker of one is known here."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from appliance.box.durable import private_folder, replacing
from appliance.release.arrivals import SHOW
from appliance.show.bundle import CHECKSUMS, LARGEST_FILE, MOST_FILES, SIGNATURE, bundle_files, unlisted_files
from appliance.stage.stage_error import StageError

_STICK = "bunraku"  # the folder on a stick in which the box looks
_NAMESPACE = "bunraku-show"
_VERIFY = ("ssh-keygen", "-Y", "verify", "-n", _NAMESPACE, "-I", "show")
_VERIFIED_WITHIN_S = 20.0
_CHUNK = 1 << 20
_DAMAGED = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, ValueError)


def pack_show(show: Path, path: Path) -> None:
    """Write the zip file; it is complete or not there at all. Raises OSError."""
    private_folder(path.parent)
    with (
        replacing(path) as stream,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed,
    ):
        for name in (*bundle_files(show), CHECKSUMS, SIGNATURE):
            if (show / name).is_file():
                packed.write(show / name, Path(_STICK, SHOW, name))


def unpack_show(path: Path, folder: Path) -> None:
    """Write the show into `folder`/show, in place of one that is there. Raises StageError, OSError."""
    shutil.rmtree(folder / SHOW, ignore_errors=True)
    room = LARGEST_FILE
    try:
        with zipfile.ZipFile(path) as packed:
            files = [one for one in packed.infolist() if not one.is_dir()]
            if len(files) > MOST_FILES:
                raise StageError(f"The file holds more than {MOST_FILES} files. No show has so many.")
            for one in files:
                name = PurePosixPath(one.filename)
                if name.parts[:2] != (_STICK, SHOW) or len(name.parts) < 3 or ".." in name.parts:
                    raise StageError(f"'{one.filename[:60]}' is no file of a show. Send the show again.")
                target = folder / SHOW / Path(*name.parts[2:])
                private_folder(target.parent)
                with packed.open(one) as reading, target.open("xb") as writing:
                    while chunk := reading.read(_CHUNK):
                        room -= len(chunk)
                        if room < 0:
                            raise StageError(f"A show has at most {LARGEST_FILE // 1_000_000} MB.")
                        writing.write(chunk)
    except _DAMAGED as error:
        raise StageError(f"The show did not arrive whole ({error}). Send it again.") from error


def require_known_maker(show: Path, keys: Path) -> None:
    """Raise StageError where nobody whose key is in `keys` (a public key a line) has signed this show."""
    try:
        public = [" ".join(line.split()[:2]) for line in keys.read_text().splitlines() if line.strip()]
    except OSError as error:
        raise StageError(f"{keys}: the keys of shows cannot be read ({error.strerror}).") from error
    if not (show / SIGNATURE).is_file():
        raise StageError(
            f"The show is not signed, and this box takes only signed ones. Sign it: ssh-keygen -Y sign "
            f"-n {_NAMESPACE} -f KEY {CHECKSUMS}"
        )
    if unlisted := unlisted_files(show):
        raise StageError(f"'{unlisted[0]}' is not in what was signed. Pack the show, and sign it again.")
    allowed = show.with_name("keys")
    try:
        allowed.write_text("".join(f"show {one}\n" for one in public if re.fullmatch(r"[\w@.-]+ \S+", one)))
        with (show / CHECKSUMS).open("rb") as signed:
            done = subprocess.run(
                (*_VERIFY, "-f", str(allowed), "-s", str(show / SIGNATURE)),
                stdin=signed,
                capture_output=True,
                timeout=_VERIFIED_WITHIN_S,
                check=False,
            )
    except (OSError, subprocess.SubprocessError) as error:
        raise StageError(f"The show's signature cannot be checked ({error}).") from error
    finally:
        with contextlib.suppress(OSError):
            allowed.unlink()
    if done.returncode:
        raise StageError("The show is not as its maker signed it, or its maker is not known to this box.")
