"""`bunraku sensors`: what the running box knows of its sensors, and changes to who is let in."""

from __future__ import annotations

import errno
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from appliance.cli.control_client import ControlClient, NoBoxError, Roll
from appliance.cli.doctor.host_view import running_stage
from appliance.cli.sensor_table import SensorTable, known_table, plain_values, unheard
from appliance.release.installed_box import box_here
from appliance.sensor.key_editing import KeyEditing, editing
from appliance.sensor.keys import KeyFileError, exposure, load_keys
from appliance.show.box import BoxConfig, load_box
from appliance.stage.stage_error import StageError

DEFAULT_KEYS = Path("sensors.keys")
NOT_TAKEN = 1
_OLD_ROLL_S = 3.0
_RESTART_S = 3.0  # show control that died is back within 1 s, on a machine that is busy
_AGAIN_S = 0.1
_PIPE_WIDTH = 160


@dataclass(frozen=True)
class Venue:
    """Which box and which key file are meant."""

    box_file: Path | None
    box: BoxConfig
    keys: Path

    @property
    def running(self) -> ControlClient:
        return ControlClient.of(self.box)


def venue(box_file: Path | None, keys: Path | None) -> Venue:
    """By the box file, the key file alone, or what lies in this folder. Raises StageError, ConfigError."""
    if box_file is not None and keys is not None:
        raise StageError("Give --box or --keys, not both: a box file names its key file.")
    box_file = box_file if keys is not None else box_here(box_file)
    box = load_box(box_file)
    if box_file is not None and box.sensors.keys is None:
        raise StageError(
            f"{box_file} names no key file, so no sensor is let in. "
            "Write `keys: sensors.keys` under sensors in it."
        )
    return Venue(box_file, box, box.sensors.keys or keys or DEFAULT_KEYS)


def people_console() -> Console:
    """Wide enough for the table where nobody looks, in a pipe."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=_PIPE_WIDTH)


def list_sensors(place: Venue, watch: bool, as_json: bool) -> None:
    """Print all sensors once, or again each second until Ctrl-C."""
    if as_json:
        print(json.dumps(_plain(place), indent=2))
        return
    console = people_console()
    if not watch:
        console.print(_picture(place))
        return
    if not console.is_terminal:
        _watch_in_pipe(place, console)
        return
    try:
        with Live(_picture(place), console=console, auto_refresh=False, screen=False) as live:
            while True:
                time.sleep(1.0)
                live.update(_picture(place), refresh=True)
    except KeyboardInterrupt:
        return


def _watch_in_pipe(place: Venue, console: Console) -> None:
    """Table after table, each at once: whoever reads may stop at any time."""
    try:
        while True:
            console.print(_picture(place), "")
            console.file.flush()
            time.sleep(1.0)
    except KeyboardInterrupt:
        return


def tell(place: Venue, address: str, *arguments: str) -> None:
    """Send one command to the running box and print its answer. Raises StageError when it is not done."""
    try:
        answer = place.running.ask(address, *arguments)
    except NoBoxError as error:
        raise StageError(f"{error} {_WHICH_BOX}" if place.running.has_port else str(error)) from None
    if not answer.done:
        raise StageError(answer.words)
    print(answer.words)


def replace_by_spare(place: Venue, broken: str, spare: str) -> int:
    """A spare takes over a name, with no cable: the two change names. The exit status."""
    return _edit(
        place,
        lambda change: change.swap(broken, spare),
        f"{broken} is now the sensor that was {spare}; the broken one is called {spare} from now on. "
        "Put it on, switch it on, stand still for a breath.",
    )


def revoke(place: Venue, name: str) -> int:
    """Let a sensor in no more. The exit status."""
    return _edit(
        place,
        lambda change: change.remove(name),
        f"{name} is revoked: with that key nobody is let in any more. To use it again, provision it again.",
    )


def rename(place: Venue, name: str, new: str) -> int:
    """Give a sensor another name. The exit status."""
    return _edit(
        place, lambda change: change.rename(name, new), f"{name} is now {new}. Shows name it by that."
    )


def read_again(place: Venue) -> int:
    """After a change by hand: have the running box take the key file. The exit status."""
    with clear_errors(place.keys):
        load_keys(place.keys)
    return _tell_box(place)


def reload(place: Venue) -> tuple[bool, str]:
    """Have the running box read the key file again: whether it is as it should be, and a sentence.

    Where a stage lives, silence is no answer: show control may be on its way back, and is asked again.
    """
    until = time.monotonic() + _RESTART_S
    while True:
        try:
            return _told_to_reload(place)
        except NoBoxError as error:
            if not place.running.has_port:
                words = "The box has no control port to be told by: the change counts when it starts again."
                return True, words
            if running_stage(place.box) is None:
                return True, f"{error} The change counts when it starts."
        if time.monotonic() >= until:
            return (
                False,
                "A box dances here, but its show control did not answer. Run: bunraku sensors reload.",
            )
        time.sleep(_AGAIN_S)


def _told_to_reload(place: Venue) -> tuple[bool, str]:
    """What `reload` gives when a box answers; raises NoBoxError when none does."""
    roll = place.running.roll()
    if roll.key_file is not None and roll.key_file.resolve() != place.keys.resolve():
        return False, f"{_other_file(roll.key_file)} and knows nothing of this change. {_THAT_BOX}"
    answer = place.running.ask("/sensors/reload")
    return answer.done, f"The running box {'took it' if answer.done else 'did not take it'}. {answer.words}"


@contextmanager
def clear_errors(path: Path) -> Iterator[None]:
    """What goes wrong with a key file, as one clear line."""
    try:
        yield
    except KeyFileError as error:
        raise StageError(f"{error}.") from None
    except FileNotFoundError:
        require_folder(path)
        raise StageError(f"There is no key file {path}. {_WHICH_KEYS}") from None
    except OSError as error:
        is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        cure = "Free some space, then run this again." if is_full else "May this user read and write there?"
        raise StageError(f"{path}: {error.strerror}. Nothing was changed. {cure}") from None


def require_folder(path: Path) -> None:
    """Raises StageError when the key file's folder is not there."""
    if not path.parent.is_dir():
        raise StageError(
            f"There is no folder {path.parent} for the key file. Nothing was changed. "
            "Make it, or correct `keys` under sensors in the box file."
        )


_WHICH_BOX = "Is it running here? Its box file (--box) tells the control port, if it is not the usual one."
_THAT_BOX = "Give the box file of that box with --box."
_WHICH_KEYS = "Name it with --keys, or the box file with --box; the first bunraku provision makes one."


def _edit(place: Venue, change_it: Callable[[KeyEditing], None], words: str) -> int:
    with clear_errors(place.keys):
        if not place.keys.exists():
            raise FileNotFoundError
        with editing(place.keys) as change:
            change_it(change)
            change.commit()
    print(words)
    return _tell_box(place)


def _tell_box(place: Venue) -> int:
    """Have the running box take the key file, and say whether it did. The exit status."""
    is_well, words = reload(place)
    print(words)
    return 0 if is_well else NOT_TAKEN


def _picture(place: Venue) -> Group:
    """What should be looked at, and below it the table: a short terminal shows the beginning."""
    try:
        roll = place.running.roll()
    except NoBoxError as error:
        return _picture_of_file(place, str(error))
    complaints = [line.complaint for line in roll.lines if line.complaint]
    complaints += _about_file(place, roll)
    parts: list[object] = [Text(f"{words}\n", style="yellow") for words in complaints]
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


def _other_file(key_file: Path) -> str:
    return f"The running box reads another key file ({key_file})"


def _about_file(place: Venue, roll: Roll) -> list[str]:
    """What would surprise at the next start: another key file, a damaged one, a changed or an open one."""
    if roll.age_s < 0 or roll.key_file is None:
        return []
    if place.box_file is not None and roll.key_file.resolve() != place.keys.resolve():
        return [f"{_other_file(roll.key_file)}, not {place.keys}. {_THAT_BOX}"]
    try:
        in_file = {(key.name, f"{key.device_id:08x}") for key in load_keys(roll.key_file).values()}
        warning = exposure(roll.key_file)
    except KeyFileError as error:
        return [
            f"{error}. The box goes on with the keys that it has; it lets nobody in when it starts again."
        ]
    except OSError:  # another user's file, or another machine's: the box's own matter
        return []
    notes = [warning] if warning else []
    if in_file != {(line.name, line.device_id) for line in roll.lines}:
        notes.append(f"{roll.key_file} has other sensors than the running box. Run: bunraku sensors reload")
    return notes


def _picture_of_file(place: Venue, why: str) -> Group:
    with clear_errors(place.keys):
        try:
            lines = unheard(load_keys(place.keys))
        except FileNotFoundError:
            raise StageError(f"{why} And there is no key file {place.keys}. {_WHICH_KEYS}") from None
        warning = exposure(place.keys)
    notes = [Text(f"{why} These sensors may come in ({place.keys}):\n", style="yellow")]
    if not lines:
        notes = [Text(f"{why} {place.keys} has no sensor yet.", style="yellow")]
    if warning:
        notes.insert(0, Text(f"{warning}\n", style="yellow"))
    return Group(*notes, known_table(lines) if lines else "")


def _plain(place: Venue) -> dict[str, object]:
    try:
        roll: Roll | None = place.running.roll()
    except NoBoxError:
        roll = None
    if roll is not None:
        return {
            "box": True,
            "age_s": round(roll.age_s, 3) if roll.age_s >= 0 else None,
            "sensors": [plain_values(one) for one in roll.lines],
        }
    with clear_errors(place.keys):
        lines = unheard(load_keys(place.keys))
    return {"box": False, "age_s": None, "sensors": [plain_values(line) for line in lines]}
