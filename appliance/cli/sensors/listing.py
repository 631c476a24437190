"""`bunraku sensors`: all sensors as the running box sees them, or as the key file has them."""

from __future__ import annotations

import json
import time

from rich.console import Group
from rich.live import Live
from rich.text import Text

from appliance.box.roster import Roster
from appliance.box.stop_signals import stop_signals
from appliance.cli.doctor.host_view import RunningStage, running_stage
from appliance.cli.sensors.box_keys import (
    THAT_BOX,
    WHICH_KEYS,
    BoxKeys,
    clear_errors,
    other_file,
    people_console,
)
from appliance.cli.sensors.table import SensorTable, known_table, plain_values, unheard
from appliance.sensor.keys import KeyFileError, exposure, load_keys
from appliance.show.programs import SOURCES
from appliance.stage.stage_error import StageError

_OLD_S = 3.0
_NO_BOX = "No box runs here."


def list_sensors(box_keys: BoxKeys, watch: bool, as_json: bool) -> None:
    """Print all sensors once, or again each second until Ctrl-C."""
    if as_json:
        print(json.dumps(_plain(box_keys), indent=2))
        return
    console = people_console()
    if not watch:
        console.print(_picture(box_keys))
        return
    with stop_signals() as is_stopped:
        if console.is_terminal:
            with Live(_picture(box_keys), console=console, auto_refresh=False, screen=False) as live:
                while not is_stopped():
                    time.sleep(1.0)
                    live.update(_picture(box_keys), refresh=True)
        while not is_stopped():  # in a pipe, each table at once: its reader may stop at any time
            console.print(_picture(box_keys), "")
            console.file.flush()
            time.sleep(1.0)


def _picture(box_keys: BoxKeys) -> Group:
    """The notes, and the table below them: a short terminal shows the beginning."""
    stage = running_stage(box_keys.box)
    if stage is None:
        return _picture_of_file(box_keys)
    roster = Roster.reported(stage.health)
    age_s = roster.age_s(time.monotonic())
    complaints = [line.complaint for line in roster.lines if line.complaint]
    complaints += _about_file(box_keys, stage)
    parts: list[object] = [Text(f"{message}\n", style="yellow") for message in complaints]
    if age_s > _OLD_S:
        parts.append(Text(f"This is {age_s:.0f} s old: the box hangs, or is very busy.\n", style="red"))
    if roster.looked_at is None:
        parts.append(Text("The box is still starting. Ask again in a moment.", style="yellow"))
    elif roster.lines:
        parts.append(SensorTable(roster.lines))
    else:
        parts.append(
            Text("The running box knows no sensor. Provision one: bunraku provision --name left-wrist")
        )
    return Group(*parts)  # type: ignore[arg-type]


def _about_file(box_keys: BoxKeys, stage: RunningStage) -> list[str]:
    """Surprises at the next start: another key file, a damaged, changed or unprotected one."""
    roster, key_file = Roster.reported(stage.health), stage.key_file
    if roster.looked_at is None or key_file is None:
        return []
    if box_keys.box.path is not None and key_file.resolve() != box_keys.keys.resolve():
        return [f"{other_file(key_file)}, not {box_keys.keys}. {THAT_BOX}"]
    try:
        in_file = {(key.name, f"{key.device_id:08x}") for key in load_keys(key_file).values()}
        warning = exposure(key_file)
    except KeyFileError as error:
        return [
            f"{error}. The box goes on with the keys that it has; it lets no sensor in when it starts again."
        ]
    except OSError:  # another user's or machine's file, which only the box can judge
        return []
    notes = [warning] if warning else []
    if in_file != {(line.name, line.device_id) for line in roster.lines if line.way not in SOURCES}:
        notes.append(f"{key_file} has other sensors than the running box. Run: bunraku sensors reload")
    return notes


def _picture_of_file(box_keys: BoxKeys) -> Group:
    with clear_errors(box_keys.keys):
        try:
            lines = unheard(load_keys(box_keys.keys))
        except FileNotFoundError:
            raise StageError(f"{_NO_BOX} And there is no key file {box_keys.keys}. {WHICH_KEYS}") from None
        warning = exposure(box_keys.keys)
    notes = [Text(f"{_NO_BOX} These sensors may come in ({box_keys.keys}):\n", style="yellow")]
    if not lines:
        notes = [Text(f"{_NO_BOX} {box_keys.keys} has no sensor yet.", style="yellow")]
    if warning:
        notes.insert(0, Text(f"{warning}\n", style="yellow"))
    return Group(*notes, known_table(lines) if lines else "")


def _plain(box_keys: BoxKeys) -> dict[str, object]:
    stage = running_stage(box_keys.box)
    if stage is None:
        with clear_errors(box_keys.keys):
            lines = unheard(load_keys(box_keys.keys))
        return {"box": False, "age_s": None, "sensors": [plain_values(line) for line in lines]}
    roster = Roster.reported(stage.health)
    age_s = None if roster.looked_at is None else round(roster.age_s(time.monotonic()), 3)
    return {"box": True, "age_s": age_s, "sensors": [plain_values(line) for line in roster.lines]}
