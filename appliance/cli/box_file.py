"""The box file for the page: shown and changed there, checked as the file itself."""

from __future__ import annotations

import contextlib
import ipaddress
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.durable import alone_in, private_folder, write_beside, write_whole
from appliance.box.served import is_loopback
from appliance.cli.preflight import LATE_TURN_S, late_candidate_problems, publish
from appliance.release.adoption import BoxFolders, Outcome, adopt, read_choice
from appliance.release.arrivals import BOX, SHOW, Arrival, look
from appliance.release.choice import CHOSEN, Choice
from appliance.release.packed_show import require_known_maker, unpack_show
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError, Problem
from appliance.show.venue_keys import venue_keys
from appliance.show.yaml_edit import with_value
from appliance.show.yaml_file import MAX_BYTES
from appliance.stage.stage_error import StageError

FROM_PAGE = "page"  # the folder below /data/bunraku in which the page's box file arrives, as from a stick
_EMPTY = "# The box file of this venue; for what it leaves out the box has values built in.\n"
_CHANGED = "Another device has changed the box file meanwhile. Read it again, then change it."
_AT_ONCE, _LATER = 0.0, float("inf")


class Change(NamedTuple):
    """text: the whole file; values: (location, value) of keys to set in it; now: restart with it at once;
    sure: what would shut people out, or let everybody in, was asked and answered; read: the file as it was
    when the browser read it, None: whatever it was.
    """

    text: str
    values: list[tuple[list[str | int], Any]]
    now: bool = False
    sure: bool = False
    read: str | None = None

    def applied(self) -> str:
        """The text with the values. Raises ValueError."""
        text = self.text
        if len(text.encode()) > MAX_BYTES:
            raise ValueError(f"A box file has at most {MAX_BYTES // 1024} kB.")
        for location, value in self.values:
            text = with_value(text, tuple(location), value)
        return text


def reported(box: Path | None, chosen: Path | None) -> dict[str, Any]:
    """For JSON: the file's text, its venue's keys, whether it can be changed and when that counts."""
    place = _place(box, chosen)
    if place is None:
        raise StageError(
            "This box has no box file: all is on this machine. Give bunraku play one: --box box.yaml."
        )
    config = load_box(place if place.exists() else None)
    return {
        "file": str(place),
        "text": _text(place),
        "keys": [one._asdict() for one in venue_keys(config)],
        **_receivers(config),
        "at_once": chosen is not None,
    }


def _text(place: Path) -> str:
    return place.read_text(encoding="utf-8-sig") if place.exists() else _EMPTY


def _receivers(config: BoxConfig) -> dict[str, Any]:
    """OSC receivers as the file has them; those built in where it lists none."""
    written = config.file.at("outputs", "osc")
    if isinstance(written, list):
        return {"receivers": [one for one in written if isinstance(one, dict)], "receivers_written": True}
    reported = [{"host": one.host, "port": one.port} for one in config.outputs.osc]
    return {"receivers": reported, "receivers_written": False}


def change(box: Path | None, chosen: Path | None, wanted: Change) -> dict[str, Any]:
    """Check and write it. For JSON: `problems` (nothing was written), or `asks` (nor was it: questions to
    answer with `sure`), else `message`: what counts from when.

    anew: all units have to start anew now. The page's process sees to it, once its browser has the answer.
    """
    place = _place(box, chosen)
    if place is None:
        raise StageError("This box has no box file that could be changed.")
    if wanted.read is not None and wanted.read != _text(place):
        return {"problems": [{"line": 0, "message": _CHANGED}]}
    try:
        text = wanted.applied()
        config = _checked(place, text)
    except ConfigError as error:
        return {"problems": [_reported(one) for one in error.problems]}
    except ValueError as error:
        return {"problems": [{"line": 0, "message": str(error)}]}
    if not wanted.sure and (asks := list(_questions(_before(place), config))):
        return {"problems": [], "asks": asks}
    if chosen is not None:
        arrival = _box_folders(chosen).data / FROM_PAGE
        arrival.mkdir(mode=0o700, exist_ok=True)
        write_whole(arrival / BOX, text.encode())
        return _adopt(chosen, look(FROM_PAGE, arrival), "box file", wanted.now)
    before = place.with_name(f"{place.name}.before")
    if place.exists():
        write_whole(before, place.read_bytes(), private=True)
    write_whole(place, text.encode())
    return {
        "problems": [],
        "message": f"{place} is written; the one before is {before.name}. It counts from the next start of "
        "bunraku play on.",
    }


def adopt_show(chosen: Path, folder: Path, source: str, now: bool = True) -> dict[str, Any]:
    """Let the show in a folder dance, as one from a stick would; for JSON, as `change`."""
    return _adopt(chosen, look(source, folder), "show", now)


def take_show(chosen: Path, file: Path, now: bool) -> dict[str, Any]:
    """The same with a packed show from another box; nothing of it stays beside what was adopted.

    Raises StageError for a file that is no show, and for one whose maker the box file does not accept.
    """
    folder = file.parent
    try:
        unpack_show(file, folder)
        console = load_box((Choice.read(chosen) or Choice()).first.box).console
        if console is not None and console.show_keys is not None:
            require_known_maker(folder / SHOW, console.show_keys)
        return adopt_show(chosen, folder, "fleet", now)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def dance_again(chosen: Path, show: str) -> dict[str, Any]:
    """Let a pair that is kept dance from now on, by its id; for JSON. Raises StageError."""
    here = Choice.read(chosen)
    if here is None:
        raise StageError("The show that this box chose at power-on cannot be read. Run bunraku doctor.")
    folders = BoxFolders(here.data, chosen.parent)
    with _alone(folders):
        saved = read_choice(folders.data)
        pair = next((one for one in (*saved.pairs, *here.pairs) if one.id == show and one.is_there), None)
        if pair is None or not pair.id:
            raise StageError("This show is not kept on the box any more. Bring it on a stick.")
        choice = saved.with_newest(pair)
        choice._replace(data=folders.data).write(folders.data / CHOSEN)
        publish(folders, Outcome(choice, True, ()), True, _AT_ONCE, restarts=False)
    return {"message": f"The {pair.source} dances again, and after the next power-on too.", "anew": True}


def _place(box: Path | None, chosen: Path | None) -> Path | None:
    """The file as the venue wrote it; on an installed box without one the place where the page's arrives."""
    choice = None if chosen is None else Choice.read(chosen)
    if choice is None:
        return box
    newest = (read_choice(choice.data).pairs or choice.pairs)[0]  # it may wait for the next power-on
    if newest.box_id:
        original = newest.box.with_suffix(".original.yaml")
        return original if original.is_file() else newest.box
    return choice.data / FROM_PAGE / BOX


def _checked(place: Path, text: str) -> BoxConfig:
    """Read beside the file, for what it names is relative to its folder. Raises ConfigError."""
    private_folder(place.parent)
    beside = write_beside(place.with_name("checked.yaml"), text.encode(), private=True)
    try:
        return load_box(beside)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink()


def _reported(one: Problem) -> dict[str, Any]:
    return {"line": one.line, "message": f"{one.message} {one.cure}".strip()}


def _before(place: Path) -> BoxConfig:
    """The settings in force until now; a broken file has nothing to lose."""
    try:
        return load_box(place if place.exists() else None)
    except ConfigError:
        return BoxConfig()


def _questions(before: BoxConfig, after: BoxConfig) -> Iterator[str]:
    """Access that a change takes from people at the venue, or gives to everybody."""
    if before.control is not None and after.control is None:
        yield "control: null takes all commands away, PANIC and BLACKOUT of this page too."
    if before.console is not None and after.console is None:
        yield "console: null takes this page away: only a person at the box brings it back."
    if before.console is not None and after.console is not None:
        was, host = before.console.host, after.console.host
        if is_loopback(host) and not is_loopback(was):
            yield f"console: host: {host} leaves this page to the box's own screen."
    for name, new, old in (
        ("console", after.console, before.console),
        ("stream", after.projector.stream, before.projector.stream),
    ):
        known = () if old is None else old.viewers
        for network in () if new is None else new.viewers:
            if network not in known and ipaddress.ip_network(network).prefixlen == 0:
                yield f"{name}: viewers: {network} lets every device in that reaches the box."


@contextlib.contextmanager
def _alone(folders: BoxFolders) -> Iterator[None]:
    """No preflight meanwhile. Raises StageError where one does not end: it may check a show from a stick."""
    try:
        with alone_in(folders.data, LATE_TURN_S), alone_in(folders.run, LATE_TURN_S):
            yield
    except BlockingIOError:
        raise StageError("The box is checking a show from a stick. Try again in a few minutes.") from None


def _box_folders(chosen: Path) -> BoxFolders:
    return BoxFolders((Choice.read(chosen) or Choice()).data, chosen.parent)


def _adopt(chosen: Path, arrival: Arrival, what: str, now: bool) -> dict[str, Any]:
    """As from a stick: on the shelf under its content's id, the one before it kept, then tried."""
    folders = _box_folders(chosen)
    with _alone(folders):
        outcome = adopt(folders, [arrival], late_candidate_problems, late=True)
        if outcome.taken:
            publish(folders, outcome, True, _AT_ONCE if now else _LATER, restarts=False)
    if not outcome.taken and outcome.choice.refused:
        return {"problems": [{"line": 0, "message": message} for message in outcome.choice.refused]}
    if not outcome.taken:
        return {"problems": [], "message": f"This {what} counts already."}
    when = "now: all but the release starts anew" if now else "after the next power-on"
    return {
        "problems": [],
        "anew": now,
        "message": f"The {what} is kept and counts {when}. The one before it stays on the box.",
    }
