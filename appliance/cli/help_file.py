"""One file to send to somebody who can help: journal, log, doctor, box file without secrets, versions."""

from __future__ import annotations

import json
import re
import tempfile
import time
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from appliance.box.child import BUNRAKU, environment, finished
from appliance.recorder.export import export_stretch
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.show.config_error import ConfigError
from appliance.show.yaml_file import read_yaml

JOURNAL_S = 180.0  # the newest minutes of the dance
_DOCTOR_WITHIN_S = 60.0
_HIDDEN = "(removed)"
_SECRET_KEY = re.compile(r"pass|secret|token|webhook|user|key", re.IGNORECASE)
_SECRETS = re.compile(r"(?<=PIN )\d{6,10}|(?<=/phone#)\S+|(?<=://)[^/\s@]+@")  # in what the box printed
_README = """Help file of a Bunraku box, made {made} on {host}.

doctor.txt     check of machine, venue and box
log.txt        last lines of the log, the newest last
status.json    state of the box as its page shows it
box.yaml       box file, without comments, passwords and keys
versions.json  machine and software
journal.bunraku  newest minutes of the show, for `bunraku replay`{journal}

The journal contains the dancer's movement. Delete this file when it is no longer needed.
"""


def help_file(
    out: Path,
    box: Path | None,
    journal: Path | None,
    log: Sequence[str],
    status: Mapping[str, Any],
    versions: Mapping[str, Any],
    doctor: str | None = None,
) -> None:
    """Write the ZIP file. journal: its folder; None: without. doctor: its output; None: it looks now.

    A part that cannot be had is replaced by the reason. Raises OSError.
    """
    parts = {
        "doctor.txt": _doctor(box) if doctor is None else doctor,
        "log.txt": without_secrets("\n".join(log)),
        "status.json": without_secrets(json.dumps(status, indent=1)),
        "box.yaml": box_without_secrets(box),
        "versions.json": json.dumps(versions, indent=1),
    }
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as whole, tempfile.TemporaryDirectory() as scratch:
        trouble = "not asked for" if journal is None else _stretch(journal, Path(scratch) / "journal.bunraku")
        if not trouble:
            whole.write(Path(scratch) / "journal.bunraku", "journal.bunraku", zipfile.ZIP_STORED)
        made = time.strftime("%Y-%m-%d %H:%M:%S")
        said = {"made": made, "host": versions.get("host", ""), "journal": trouble and f": {trouble}"}
        whole.writestr("README.txt", _README.format(**said))
        for name, text in parts.items():
            whole.writestr(name, text)


def box_without_secrets(box: Path | None) -> str:
    """The settings of a box file without comments; values of secret keys are removed."""
    if box is None:
        return "# This box has no box file.\n"
    try:
        return yaml.safe_dump(_hidden(read_yaml(box).values), sort_keys=False, allow_unicode=True)
    except (ConfigError, RecursionError) as error:
        return f"# The box file cannot be read: {type(error).__name__}.\n"


def without_secrets(text: str) -> str:
    """Printed text without PINs, phones' codes, and names and passwords in addresses."""
    return _SECRETS.sub(_HIDDEN, text)


def _hidden(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            key: _HIDDEN if _SECRET_KEY.search(str(key)) and isinstance(one, str) else _hidden(one)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [_hidden(one) for one in value]
    return without_secrets(value) if isinstance(value, str) else value


def _doctor(box: Path | None) -> str:
    named = () if box is None else ("--box", str(box))
    env = environment(COLUMNS="120", NO_COLOR="1")
    done = finished((*BUNRAKU, "doctor", *named), _DOCTOR_WITHIN_S, env)
    return without_secrets(done.stdout + done.stderr)


def _stretch(journal: Path, out: Path) -> str:
    """Write the newest minutes of the newest run; why not, or ""."""
    try:
        run = read_journal(journal).runs[-1]
        times = run.ticks["frame_time"]
        seconds = float(times[-1] - times[0]) if len(times) else 0.0
        export_stretch(journal, out, run, max(0.0, seconds - JOURNAL_S), JOURNAL_S + 1.0)
    except (JournalError, OSError, IndexError) as error:
        return f"missing ({error})"
    return ""
