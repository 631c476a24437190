"""Disks and memory: is there room, can it be written, does a power cut hurt, is it worn out?"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView
from appliance.release.choice import DATA, RUN, STICK, Choice

LEAST_FREE_BYTES, LEAST_FREE_SHARE = 256 << 20, 0.10
LEAST_MEMORY_KB = 200 << 10
RELEASES = Path("/data/bunraku-releases")  # of a box made from the image
WORN = 8  # of ten steps of an eMMC's life
_KEPT = "the journal, the place of the dance, what the box knows about sensors"


def data_folders(host: HostView) -> Iterator[Finding]:
    """Where the box keeps what must survive a power cut."""
    box = host.box
    wanted = {"state": box.state_folder, "journal": box.journal.folder}
    folders = {folder for folder in wanted.values() if folder is not None}
    if host.at(DATA).is_dir():
        folders.add(DATA)
    if not folders:
        yield better(
            "data",
            "The box file names neither `state` nor `journal: folder`: nothing survives a power cut.",
            "Add both; the installed box has them under /data.",
        )
    for folder in sorted(folders):
        yield _folder(host, folder)


def _folder(host: HostView, folder: Path) -> Finding:
    """The verdict on one of them, or on its nearest existing parent."""
    what, there = "data", host.at(folder)
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        room = os.statvfs(there)
    except OSError as error:
        return wrong(
            what,
            f"{folder} cannot be read ({error.strerror}): {_KEPT} are lost at a power cut.",
            "`dmesg | tail` says why; often the card or its contact.",
        )
    free, whole = room.f_bavail * room.f_frsize, room.f_blocks * room.f_frsize
    words = f"{folder}: {free / 1e6:,.0f} of {whole / 1e6:,.0f} MB are free."
    if room.f_flag & os.ST_RDONLY:
        return wrong(
            what,
            f"{folder} cannot be written: {_KEPT} are lost at a power cut. The audience sees nothing.",
            "After an error Linux writes no more: `dmesg | tail`, then a new card or disk.",
        )
    if not os.access(there, os.W_OK):
        return wrong(
            what,
            f"This user may not write in {folder}.",
            f"`sudo chown -R bunraku {folder}`, or run me as that user.",
        )
    if free < min(LEAST_FREE_BYTES, LEAST_FREE_SHARE * whole):
        return better(
            what,
            f"{words} The journal keeps less than it should. The audience sees nothing.",
            "`journal: {minutes: 10}` in the box file, or remove what else lies there.",
        )
    return ok(what, words)


def media(host: HostView) -> Iterator[Finding]:
    """The data partition that /etc/fstab names, and the stick."""
    mounted = host.mounts()
    rows = (line.split() for line in (host.text("/etc/fstab") or "").splitlines())
    named = {row[1] for row in rows if len(row) > 1 and not row[0].startswith("#")}
    where = str(DATA.parent)
    if where in named and where not in mounted:
        yield wrong(
            "data partition",
            f"It is not there: {_KEPT} are lost at a power cut. The audience sees nothing.",
            "`lsblk -f` and `dmesg | tail` say why; the disk's contact, or a new disk.",
        )
    elif where in mounted:
        yield ok("data partition", f"It is there ({mounted[where][0]}).")
    if str(STICK.parent) in mounted:
        yield ok("stick", "One is plugged in, to read.")


def system_partition(host: HostView) -> Iterator[Finding]:
    """On an appliance the system partition is read-only: a power cut cannot damage it."""
    kind, options = host.mounts().get("/", ("", ()))
    if not kind:
        return
    if kind in ("overlay", "squashfs") or "ro" in options:
        yield ok("system", "Its partition is read-only: a power cut cannot damage it.")
    else:
        yield better(
            "system",
            "Its partition is writable: a power cut may damage it.",
            "For a tour: the image (`make image`), or a read-only root with an overlay.",
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
                "Replace it before the next city; docs/touring.md says how.",
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
    words = f"{free_kb / 1024:,.0f} MiB are available."
    if free_kb < LEAST_MEMORY_KB:
        yield wrong("memory", f"{words} The kernel may end the projector.", "End other programs.")
    else:
        yield ok("memory", words)
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
    yield ok("show", f"{chosen.first.show}, box file {chosen.first.box} ({chosen.first.source}).")
    if chosen.refused:
        words = "What is new was refused, and the show before dances:\n" + "\n".join(chosen.refused)
        yield better("show", words, "Mend it on the stick, and plug it in again.")
    for one in chosen.aside:
        yield better("show", one.words, "Mend it, and bring it again on a stick.")


def releases(host: HostView) -> Iterator[Finding]:
    """Installed releases that did not dance at a power-on; bunraku-install leaves a note."""
    for note in sorted(host.at(RELEASES).glob("*.aside")):
        version, reason = note.stem, note.read_text(errors="replace").strip()
        yield better(
            "release",
            f"{version} is put aside: {reason}. The release that came with the image dances.",
            f"Install it again from a stick, or try it again: sudo bunraku-install --use {version}",
        )
