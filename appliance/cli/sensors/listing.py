"""`bunraku sensors`: all sensors as the running box sees them, or as the key file has them."""

from __future__ import annotations

import json
import time

from rich.console import Group
from rich.live import Live
from rich.text import Text

from appliance.box.stop_signals import stop_signals
from appliance.cli.sensors.box_keys import (
    THAT_BOX,
    WHICH_KEYS,
    BoxKeys,
    clear_errors,
    other_file,
    people_console,
)
from appliance.cli.sensors.control_client import NoBoxError, Roll
from appliance.cli.sensors.table import SensorTable, known_table, plain_values, unheard
from appliance.sensor.keys import KeyFileError, exposure, load_keys
from appliance.show.programs import SOURCES
from appliance.stage.stage_error import StageError

_OLD_ROLL_S = 3.0


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
    try:
        roll = box_keys.running.roll()
    except NoBoxError as error:
        return _picture_of_file(box_keys, str(error))
    complaints = [line.complaint for line in roll.lines if line.complaint]
    complaints += _about_file(box_keys, roll)
    parts: list[object] = [Text(f"{message}\n", style="yellow") for message in complaints]
    if roll.age_s > _OLD_ROLL_S:
        parts.append(Text(f"This is {roll.age_s:.0f} s old: the box hangs, or is very busy.\n", style="red"))
    if roll.age_s < 0:
        parts.append(Text("The box is still starting. Ask again in a moment.", style="yellow"))
    elif roll.lines:
        parts.append(SensorTable(roll.lines))
    else:
        parts.append(
            Text("The running box knows no sensor. Provision one: bunraku provision --name left-wrist")
        )
    return Group(*parts)  # type: ignore[arg-type]


def _about_file(box_keys: BoxKeys, roll: Roll) -> list[str]:
    """Surprises at the next start: another key file, a damaged, changed or unprotected one."""
    if roll.age_s < 0 or roll.key_file is None:
        return []
    if box_keys.box.path is not None and roll.key_file.resolve() != box_keys.keys.resolve():
        return [f"{other_file(roll.key_file)}, not {box_keys.keys}. {THAT_BOX}"]
    try:
        in_file = {(key.name, f"{key.device_id:08x}") for key in load_keys(roll.key_file).values()}
        warning = exposure(roll.key_file)
    except KeyFileError as error:
        return [
            f"{error}. The box goes on with the keys that it has; it lets no sensor in when it starts again."
        ]
    except OSError:  # another user's or machine's file, which only the box can judge
        return []
    notes = [warning] if warning else []
    if in_file != {(line.name, line.device_id) for line in roll.lines if line.way not in SOURCES}:
        notes.append(f"{roll.key_file} has other sensors than the running box. Run: bunraku sensors reload")
    return notes


def _picture_of_file(box_keys: BoxKeys, why: str) -> Group:
    with clear_errors(box_keys.keys):
        try:
            lines = unheard(load_keys(box_keys.keys))
        except FileNotFoundError:
            raise StageError(f"{why} And there is no key file {box_keys.keys}. {WHICH_KEYS}") from None
        warning = exposure(box_keys.keys)
    notes = [Text(f"{why} These sensors may come in ({box_keys.keys}):\n", style="yellow")]
    if not lines:
        notes = [Text(f"{why} {box_keys.keys} has no sensor yet.", style="yellow")]
    if warning:
        notes.insert(0, Text(f"{warning}\n", style="yellow"))
    return Group(*notes, known_table(lines) if lines else "")


def _plain(box_keys: BoxKeys) -> dict[str, object]:
    try:
        roll = box_keys.running.roll()
    except NoBoxError:
        with clear_errors(box_keys.keys):
            lines = unheard(load_keys(box_keys.keys))
        return {"box": False, "age_s": None, "sensors": [plain_values(line) for line in lines]}
    age_s = round(roll.age_s, 3) if roll.age_s >= 0 else None
    return {"box": True, "age_s": age_s, "sensors": [plain_values(line) for line in roll.lines]}
