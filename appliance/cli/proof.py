"""Measures what the page wants proven, and keeps it as a document: `python -m appliance.cli.proof`."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from appliance.box.child import BUNRAKU, end_child, start_child
from appliance.box.parent_death import end_with_parent
from appliance.box.runtime_folder import runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.cli.doctor.finding import for_phone
from appliance.console.proofs import FOLDER, Proofs
from appliance.console.proving import SHOW_GOES, Proving, Wanted
from appliance.console.show_goes import show_goes
from appliance.outputs.frame_reader import FrameReader
from appliance.release.choice import Choice, box_of, files_named
from appliance.show.box import load_box
from appliance.show.bundle import bundle_files, default_show_path

_LOOK_S = 0.2
_ENDS_WITHIN_S = 20.0  # measure ends its box and its sensor
_MODELS = ("/proc/device-tree/model", "/sys/class/dmi/id/product_name")
_PACKAGES = ("bunraku", "onnxruntime", "numpy")
_ENDED = "It was ended before its end. Nothing was kept."


def main(given: Sequence[str]) -> int:
    """Prove what the page of a box wants; the arguments name the box: `--box FILE` or `--chosen FILE`."""
    from appliance.cli.console import devices_file_made

    end_with_parent()
    box, chosen = files_named(given)
    try:
        path = box_of(box, chosen)
        config = load_box(path)
        return prove(runtime_folder(config), Proofs(devices_file_made(config).parent / FOLDER), path, chosen)
    except Exception as error:
        from appliance.cli.app import refuse

        refuse(error)


def prove(runtime: Path, proofs: Proofs, box: Path | None, chosen: Path | None) -> int:
    """Prove what is wanted, and keep it; 1 where that did not work, which the progress says."""
    proving = Proving(runtime)
    wanted = proving.wanted()
    if wanted is None:
        return 0
    try:
        show, name = _show(runtime, chosen)
        if wanted.kind == "latency":
            document = _latency(proving, wanted, show, box, partial(show_goes, runtime))
        else:
            document = _doctor(proving, box)
        about = {"kind": wanted.kind, "made": time.time(), "host": socket.gethostname()}
        about |= {"machine": machine(), "software": software()}
        about |= {"show": {"name": name, "checksum": checksum(show)}, "box_file": about_file(box)}
        proving.report(saved=proofs.add(about | document))
    except (_NotProvenError, OSError) as error:
        proving.report(trouble=str(error))
        return 1
    finally:
        proving.end()
    return 0


class _NotProvenError(Exception):
    """Nothing to keep; the message says why."""


def _latency(
    proving: Proving, wanted: Wanted, show: Path, box: Path | None, goes: Callable[[], bool]
) -> dict[str, Any]:
    """The measurement's figures and limits, and its readings in phase with the sensor."""
    named = ("--box", str(box)) if box is not None else ()
    with tempfile.TemporaryDirectory(prefix="bunraku-prove-") as scratch:
        reported = Path(scratch) / "progress"
        reported.touch()
        command = ("measure", "--seconds", str(wanted.seconds), "--progress", str(reported))
        said = _run(proving, (*command, "--show", str(show), *named), _copying(reported, proving), goes)
        lines = [json.loads(line) for line in reported.read_text().splitlines()]
    if not lines or "figures" not in lines[-1]:
        raise _NotProvenError(f"It could not be measured. {said.strip()[-600:]}")
    in_phase = lines[: next(place for place, one in enumerate(lines) if one.get("phase") == "free")]
    limits = lines[-1]["limits"]
    return {
        "holds": all(limit["holds"] for limit in limits),
        "seconds": wanted.seconds,
        "settling_s": in_phase[0]["settling_s"],
        "at_s": [at for one in in_phase for at in one.get("at_s", ())],
        "transport_ms": [ms for one in in_phase for ms in one.get("transport_ms", ())],
        "figures": lines[-1]["figures"],
        "limits": limits,
    }


def _doctor(proving: Proving, box: Path | None) -> dict[str, Any]:
    said = _run(proving, ("doctor", "--json", *(("--box", str(box)) if box is not None else ())))
    try:
        findings = json.loads(said)
    except ValueError:
        raise _NotProvenError(f"The doctor did not end its look. {said.strip()[-600:]}") from None
    reported = [{part: for_phone(message) for part, message in one.items()} for one in findings]
    return {"holds": all(one["verdict"] != "wrong" for one in findings), "findings": reported}


def _run(
    proving: Proving,
    arguments: tuple[str, ...],
    on_output: Callable[[], None] = lambda: None,
    show_goes_on: Callable[[], bool] = lambda: False,
) -> str:
    """The output of one of our commands; ended when it is no longer wanted, or when the show goes on."""
    with tempfile.TemporaryFile() as out, stop_signals() as is_ended:
        child = start_child((*BUNRAKU, *arguments), stdout=out, stderr=subprocess.STDOUT)
        try:
            while child.poll() is None:
                if proving.wanted() is None or is_ended():
                    raise _NotProvenError(_ENDED)
                if show_goes_on():
                    raise _NotProvenError(f"{SHOW_GOES} {_ENDED}")
                on_output()
                proving.report()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(_LOOK_S)
            on_output()
        finally:
            end_child(child, _ENDS_WITHIN_S, signal.SIGINT)  # measure then ends its box and its sensor
        out.seek(0)
        return out.read().decode(errors="replace")


def _copying(reported: Path, proving: Proving) -> Callable[[], None]:
    """Carries what measure tells to where the page reads it, as far as it is written."""
    done = 0

    def copy() -> None:
        nonlocal done
        with reported.open("rb") as stream:
            stream.seek(done)
            part = stream.read()
        part = part[: part.rfind(b"\n") + 1]
        done += len(part)
        if part:
            with proving.progress.open("ab") as progress:
                progress.write(part)

    return copy


def machine() -> dict[str, Any]:
    """Model, processor, cores, memory and system of this machine, as far as it tells."""
    model = next((text for path in _MODELS if (text := _text(path))), "")
    named = [line for line in _text("/proc/cpuinfo").splitlines() if line.startswith("model name")]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "model": model,
        "processor": named[0].partition(":")[2].strip() if named else platform.machine(),
        "cores": os.cpu_count(),
        "memory_mb": round(memory / 1e6),
        "system": f"{platform.system()} {platform.release()}",
    }


def software() -> dict[str, str]:
    """Versions of what dances."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def checksum(show: Path) -> str:
    """Hash of names and contents of all files of a show."""
    whole = hashlib.sha256()
    for name in bundle_files(show):
        with (show / name).open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        whole.update(os.fsencode(f"{name}\0{digest}\n"))
    return whole.hexdigest()[:16]


def about_file(box: Path | None) -> dict[str, str] | None:
    """Name and checksum of the box file; None without one."""
    if box is None:
        return None
    return {"name": box.name, "checksum": hashlib.sha256(box.read_bytes()).hexdigest()[:16]}


def _show(runtime: Path, chosen: Path | None) -> tuple[Path, str]:
    """Folder and name of the show that dances here, or that was chosen, or that comes with the box."""
    with contextlib.closing(FrameReader(runtime)) as frames:
        frames.newest(time.monotonic())
        if frames.facts is not None:
            return frames.facts.show_directory, frames.facts.show_name
    choice = None if chosen is None else Choice.read(chosen)
    show = default_show_path() if choice is None else choice.first.show
    return show, show.name


def _text(path: str) -> str:
    try:
        return Path(path).read_text(errors="replace").strip("\0\n ")
    except OSError:
        return ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
