"""The box and the key file that a command about sensors means, and how the box learns of a change."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from appliance.box.mounts import memory_of
from appliance.cli.doctor.host_view import running_stage
from appliance.cli.sensors.control_client import ControlClient, NoBoxError
from appliance.release.installed_box import box_here
from appliance.sensor.key_editing import KeyEditing, editing
from appliance.sensor.keys import KeyFileError
from appliance.show.box import BoxConfig, load_box
from appliance.stage.stage_error import StageError

DEFAULT_KEYS = Path("sensors.keys")
NOT_TAKEN = 1
_RESTART_S = 3.0  # show control that died is back within 1 s, on a machine that is busy
_AGAIN_S = 0.1
_PIPE_WIDTH = 160
WHICH_KEYS = "Name it with --keys, or the box file with --box; the first bunraku provision makes one."
THAT_BOX = "Give the box file of that box with --box."
_WHICH_BOX = "Is it running here? Its box file (--box) tells the control port, if it is not the usual one."


@dataclass(frozen=True)
class BoxKeys:
    """A box and its key file."""

    box: BoxConfig
    keys: Path

    @property
    def control(self) -> ControlClient:
        return ControlClient.of(self.box)


def box_keys_of(box_file: Path | None, keys: Path | None) -> BoxKeys:
    """From the box file, only the key file, or the files in this folder. Raises StageError, ConfigError."""
    if box_file is not None and keys is not None:
        raise StageError("Give --box or --keys, not both: a box file names its key file.")
    box = load_box(box_file if keys is not None else box_here(box_file))
    if box.path is not None and box.sensors.keys is None:
        raise StageError(
            f"{box.path} names no key file, so no sensor is let in. "
            "Write `keys: sensors.keys` under sensors in it."
        )
    return BoxKeys(box, box.sensors.keys or keys or DEFAULT_KEYS)


def people_console() -> Console:
    """As wide as the terminal; in a pipe wide enough for the whole table."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=_PIPE_WIDTH)


def send_command(box_keys: BoxKeys, address: str, name: str | None) -> None:
    """Send a command for the sensor of that name, or for all, to the running box and print the answer.

    Raises StageError when it is not done.
    """
    try:
        answer = box_keys.control.ask(address, *([name] if name else []))
    except NoBoxError as error:
        raise StageError(f"{error} {_WHICH_BOX}" if box_keys.control.has_port else str(error)) from None
    if not answer.done:
        raise StageError(answer.message)
    print(answer.message)


def edit_keys(box_keys: BoxKeys, change_it: Callable[[KeyEditing], None], message: str) -> int:
    """Change the key file and have the running box read it. Returns the exit status."""
    with clear_errors(box_keys.keys):
        if not box_keys.keys.exists():
            raise FileNotFoundError
        with editing(box_keys.keys) as change:
            change_it(change)
            change.commit()
    print(message)
    if why := forgotten(box_keys.keys):
        print(why)
    return reload_and_say(box_keys)


def forgotten(keys: Path) -> str:
    """That a key file is gone at power-off, a sentence; "" where it lasts."""
    memory = memory_of(keys.parent)
    return memory and (
        f"{keys} is in memory, on {memory}: this change is gone at power-off, and the box is a stranger to "
        "its sensors then. Give /data a separate partition: bunraku doctor."
    )


def reload_and_say(box_keys: BoxKeys) -> int:
    """Have the running box read the key file, and report whether it did. Returns the exit status."""
    is_well, message = reload_keys(box_keys)
    print(message)
    return 0 if is_well else NOT_TAKEN


def reload_keys(box_keys: BoxKeys) -> tuple[bool, str]:
    """Have the running box read the key file again: whether it is as it should be, and a sentence.

    If a stage runs, silence is no answer: show control may be restarting, and is asked again.
    """
    until = time.monotonic() + _RESTART_S
    while True:
        try:
            return _ask_to_reload(box_keys)
        except NoBoxError as error:
            if not box_keys.control.has_port:
                message = "The box has no control port: the change counts when it starts again."
                return True, message
            if running_stage(box_keys.box) is None:
                return True, f"{error} The change counts when it starts."
        if time.monotonic() >= until:
            return (
                False,
                "A box dances here, but its show control did not answer. Run: bunraku sensors reload.",
            )
        time.sleep(_AGAIN_S)


def _ask_to_reload(box_keys: BoxKeys) -> tuple[bool, str]:
    """The answer of a box to `reload_keys`; raises NoBoxError when none answers."""
    stage = running_stage(box_keys.box)
    key_file = stage.key_file if stage is not None else None
    if key_file is not None and key_file.resolve() != box_keys.keys.resolve():
        return False, f"{other_file(key_file)} and knows nothing of this change. {THAT_BOX}"
    answer = box_keys.control.ask("/sensors/reload")
    return answer.done, f"The running box {'took it' if answer.done else 'did not take it'}. {answer.message}"


def other_file(key_file: Path) -> str:
    """The first half of a sentence."""
    return f"The running box reads another key file ({key_file})"


@contextmanager
def clear_errors(path: Path) -> Iterator[None]:
    """Turn errors about a key file into StageError, one clear line."""
    try:
        yield
    except KeyFileError as error:
        raise StageError(f"{error}.") from None
    except FileNotFoundError:
        require_folder(path)
        raise StageError(f"There is no key file {path}. {WHICH_KEYS}") from None
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
