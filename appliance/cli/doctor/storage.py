"""Disks and memory: is there room, can it be written, does a power cut hurt, is it worn out?"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from appliance.box.mounts import Mount, in_memory, mount_of
from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView
from appliance.release.choice import DATA, RUN, STICK, Choice
from appliance.show.config_error import ConfigError
from appliance.show.yaml_file import read_yaml

LEAST_FREE_BYTES, LEAST_FREE_SHARE = 256 << 20, 0.10
LEAST_MEMORY_KB = 200 << 10
RELEASES = Path("/data/bunraku-releases")  # folder of a box made from the image
WORN = 8  # used, of ten steps of an eMMC's life
_WITHOUT_JOURNAL = ("vfat", "msdos", "exfat", "ext2", "fuseblk", "ntfs3")
_LOST = "sensors' keys, neutral poses, shows from sticks and the journal"
_SAVED = "the journal, the place of the dance, what the box knows about sensors"


def data_folders(host: HostView) -> Iterator[Finding]:
    """Where the box keeps what must survive a power cut."""
    box, mounted = host.box, host.mounts()
    keys = box.sensors.keys
    wanted = (box.state_folder, box.journal.folder, keys.parent if keys is not None else None)
    folders = {folder for folder in wanted if folder is not None}
    if host.at(DATA).is_dir():
        folders.add(DATA)
    if not folders:
        yield better(
            "data",
            "The box file names neither `state` nor `journal: folder`: nothing survives a power cut.",
            "Add both; the installed box has them under /data.",
        )
    for folder in sorted(folders):
        yield _folder(host, folder, mounted)


def _folder(host: HostView, folder: Path, mounted: Sequence[Mount]) -> Finding:
    """The verdict on one of them, or on its nearest existing parent."""
    what, there = "data", host.at(folder)
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        room = os.statvfs(there)
    except OSError as error:
        return wrong(
            what,
            f"{folder} cannot be read ({error.strerror}): {_SAVED} are lost at a power cut.",
            "`dmesg | tail` says why; often the card or its contact.",
        )
    disk = mount_of(folder.resolve() if host.is_here else folder, mounted)
    if disk is not None and in_memory(disk, mounted):
        return wrong(
            what,
            f"{folder} is in memory ({disk.kind}), not on a disk: {_LOST} are gone at power-off.",
            "Give /data a separate partition, and keep a read-only root's overlay off it "
            "(`overlayroot=tmpfs:recurse=0` in the kernel's command line). Until then provision the sensors "
            "again after each power-on.",
        )
    free, whole = room.f_bavail * room.f_frsize, room.f_blocks * room.f_frsize
    message = f"{folder}: {free / 1e6:,.0f} of {whole / 1e6:,.0f} MB are free."
    if room.f_flag & os.ST_RDONLY:
        return wrong(
            what,
            f"{folder} cannot be written: {_SAVED} are lost at a power cut. The audience sees nothing.",
            "After an error Linux writes no more: `dmesg | tail`, then a new card or disk.",
        )
    if not os.access(there, os.W_OK):
        return wrong(
            what,
            f"This user may not write in {folder}.",
            f"`sudo chown -R bunraku {folder}`, or run me as that user.",
        )
    if (why := _why_not_saved(there)) is not None:
        return wrong(
            what,
            f"{folder} does not keep what is written there ({why}): {_SAVED} are lost at a power cut.",
            "`dmesg | tail` says why; then a new card or disk.",
        )
    if disk is not None and disk.kind in _WITHOUT_JOURNAL:
        return better(
            what,
            f"{message} It is on {disk.kind}, which a power cut can damage: {_SAVED} may be lost with it.",
            "`sudo mkfs.ext4 -L data /dev/sdX1` on an empty one, and its line in fstab (docs/touring.md).",
        )
    if free < min(LEAST_FREE_BYTES, LEAST_FREE_SHARE * whole):
        return better(
            what,
            f"{message} The journal keeps less than it should. The audience sees nothing.",
            "`journal: {minutes: 10}` in the box file, or remove what else lies there.",
        )
    return ok(what, f"{message} What is written there lasts{f' ({disk.kind})' if disk is not None else ''}.")


def _why_not_saved(folder: Path) -> str | None:
    """Write a file, have it leave the cache, and read it from the disk; None where it came back whole."""
    written, name = os.urandom(4096), None
    try:
        descriptor, name = tempfile.mkstemp(prefix=".doctor-", dir=folder)
        with os.fdopen(descriptor, "rb+", buffering=0) as file:
            file.write(written)
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
            file.seek(0)
            is_whole = file.read() == written
    except OSError as error:
        return str(error.strerror).lower()
    finally:
        if name is not None:
            with contextlib.suppress(OSError):
                Path(name).unlink()
    return None if is_whole else "a file came back changed"


def media(host: HostView) -> Iterator[Finding]:
    """The data partition that /etc/fstab names, and the stick."""
    mounted = {str(one.point): one.kind for one in host.mounts()}
    rows = (line.split() for line in (host.text("/etc/fstab") or "").splitlines())
    named = {row[1] for row in rows if len(row) > 1 and not row[0].startswith("#")}
    where = str(DATA.parent)
    if where in named and where not in mounted:
        yield wrong(
            "data partition",
            f"It is not there: {_SAVED} are lost at a power cut. The audience sees nothing.",
            "`lsblk -f` and `dmesg | tail` say why; the disk's contact, or a new disk.",
        )
    elif where in mounted:
        yield ok("data partition", f"It is there ({mounted[where]}).")
    if str(STICK.parent) in mounted:
        yield ok("stick", "One is plugged in, to read.")


def system_partition(host: HostView) -> Iterator[Finding]:
    """On an appliance the system partition is read-only: a power cut cannot damage it."""
    mounted = host.mounts()
    root = mount_of(Path("/"), mounted)
    if root is None:
        return
    if root.kind == "overlay" and in_memory(root, mounted):
        yield ok(
            "system",
            "Its partition is read-only, and changes to it stay in memory: a power cut cannot damage it. "
            "Permanent files are under 'data'.",
        )
    elif (
        root.kind == "squashfs"
        or root.is_read_only
        or (root.kind == "overlay" and not root.option("upperdir"))
    ):
        yield ok("system", "Its partition is read-only: a power cut cannot damage it.")
    else:
        yield better(
            "system",
            "Its partition is writable: a power cut may damage it.",
            "For a tour: the image (`make image`), or a read-only root with an overlay, once /data is a "
            "separate partition.",
        )


def wear(host: HostView) -> Iterator[Finding]:
    """An eMMC reports its wear; SD cards do not."""
    for device in host.found("/sys/block/mmcblk*/device"):
        name, kind = device.parent.name, host.text(device / "type")
        steps = [int(word, 0) for word in (host.text(device / "life_time") or "").split()]
        if steps and max(steps) >= WORN:
            yield wrong(
                f"wear of {name}",
                f"{10 * max(steps)} % of its life are over.",
                "Replace it before the next city: a new card or disk, installed like the first one.",
            )
        elif steps and max(steps) > 0:
            yield ok(f"wear of {name}", f"At most {10 * max(steps)} % of its life are over.")
        elif kind == "SD":
            yield ok(f"wear of {name}", "An SD card does not tell: a new industrial one each season.")


def memory(host: HostView) -> Iterator[Finding]:
    """Room for the box, and nothing that is paged out."""
    rows = dict(line.split(":", 1) for line in (host.text("/proc/meminfo") or "").splitlines())
    try:
        free_kb = int(rows["MemAvailable"].split()[0])
    except (KeyError, ValueError, IndexError):
        return
    message = f"{free_kb / 1024:,.0f} MiB are available."
    if free_kb < LEAST_MEMORY_KB:
        yield wrong("memory", f"{message} The kernel may end the projector.", "End other programs.")
    else:
        yield ok("memory", message)
    swaps = [line.split()[0] for line in (host.text("/proc/swaps") or "").splitlines()[1:]]
    on_disk = [name for name in swaps if "zram" not in name]
    if on_disk:
        yield better(
            "swap",
            f"{', '.join(on_disk)}: a card wears out by it, and processes wait for it.",
            "`sudo swapoff -a`, and take it out of /etc/fstab.",
        )


def choice(host: HostView) -> Iterator[Finding]:
    """Which show was chosen at power-on, what was refused, and what did not dance."""
    chosen = Choice.read(host.at(RUN / "chosen.json"))
    if chosen is None:
        return
    yield ok(
        "show", f"{_name_of(chosen.first.show)} ({chosen.first.source}), box file {chosen.first.box.name}."
    )
    if chosen.refused:
        message = "The new show was refused, and the one before it dances:\n" + "\n".join(chosen.refused)
        yield better("show", message, "Mend it on the stick, and plug it in again.")
    for one in chosen.aside:
        yield better("show", one.message, "Mend it, and bring it again on a stick.")


def _name_of(show: Path) -> str:
    """As its show.yaml has it; the folder's name where that cannot be read."""
    try:
        name = read_yaml(show / "show.yaml").values.get("name")
    except ConfigError:
        name = None
    return f"'{name}'" if isinstance(name, str) else show.name


def releases(host: HostView) -> Iterator[Finding]:
    """Installed releases that did not dance at a power-on; bunraku-release leaves a note."""
    for note in sorted(host.at(RELEASES).glob("*.aside")):
        version, reason = note.stem, note.read_text(errors="replace").strip()
        yield better(
            "release",
            f"{version} is put aside: {reason}. The release that came with the image dances.",
            f"Install it again from a stick, or try it again: sudo bunraku release use {version}",
        )
