"""Choosing the show: what is new is copied and checked; a broken one is refused, the last good goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from appliance.box.durable import write_whole
from appliance.pose.foreign_file import stored_json
from appliance.release.arrivals import Arrival
from appliance.release.choice import APPLIANCE_BOX, CHOSEN, DATA, RUN, Choice, ShowAndBox, appliance_box

if TYPE_CHECKING:
    from appliance.release.shelf import Shelf

Check = Callable[
    [Path, Path], list[str]
]  # a show, a box file: why they cannot be danced; nothing when they can
SEEN = "seen.json"
_GOES_ON = "It is not danced; what danced before goes on."


class BoxFolders(NamedTuple):
    """data: what is kept over power-off; run: in memory, where all processes of the box look."""

    data: Path = DATA
    run: Path = RUN

    @property
    def moved(self) -> dict[str, str]:
        """The built-in box file's value, and its replacement."""
        usual = {str(DATA): str(self.data), str(RUN): str(self.run)}
        return {name: place for name, place in usual.items() if name != place}


class Outcome(NamedTuple):
    """choice: to be kept; taken: something new dances from now on; messages: what people should know."""

    choice: Choice
    taken: bool
    messages: tuple[str, ...]

    def packed(self) -> bytes:
        """For the process that waits for it."""
        return json.dumps([self.choice.plain(), self.taken, self.messages]).encode()

    @staticmethod
    def unpacked(answer: bytes) -> Outcome:
        """As packed; raises ValueError."""
        choice, taken, messages = json.loads(answer)
        return Outcome(Choice.of(choice), bool(taken), tuple(messages))


def read_choice(data: Path) -> Choice:
    """The last choice, as far as it still exists; without one nothing (the built-in show and box file)."""
    choice = Choice.read(data / CHOSEN) or Choice(pairs=())
    pairs = (one.here() for one in choice.pairs if one.id)
    return choice._replace(pairs=tuple(one for one in pairs if one.is_there))


def chosen_before(folders: BoxFolders) -> Choice:
    """The same, without pairs that did not dance since power-on: the keeper may not have noted that yet."""
    return read_choice(folders.data).without(Choice.read(folders.run / CHOSEN) or Choice())


def adopt(folders: BoxFolders, arrivals: list[Arrival], check: Check, late: bool = False) -> Outcome:
    """Take what is new and sound. The newest arrival counts; the stick goes before the boot partition.

    late: while a show runs, when a check may fail because time or memory is short: anything refused then is
    checked once more at the next power-on.
    """
    before, seen = chosen_before(folders), _read_seen(folders.data)
    lost = _lost(folders.data, seen)
    fresh = [one for one in arrivals if one.listing and _is_new(one, seen, lost)]
    refused = [
        message
        for one in arrivals
        if one.listing and one not in fresh
        for message in seen[one.source]["refused"]
    ]
    if not fresh:
        return Outcome(before._replace(refused=tuple(refused)), False, ())
    choice, taken, said = before, False, []
    brought: frozenset[str] = frozenset()  # a show from the stick goes with a box file from elsewhere
    for arrival in fresh:
        lacking = arrival.without(brought)
        if not lacking.listing:
            seen[arrival.source] = _seen(arrival, [], "")
            continue
        newest, problems, is_final = _take(folders, lacking, choice, check)
        refused += problems
        said += problems
        looked_at = arrival if is_final and (newest or not late) else arrival._replace(listing=[])
        seen[arrival.source] = _seen(looked_at, problems, newest.id if newest else "")
        if newest is not None:
            taken = taken or newest.id != (choice.pairs or (ShowAndBox(),))[0].id
            choice, brought = choice.with_newest(newest), brought | lacking.parts
            said.append(f"{newest.source[0].upper()}{newest.source[1:]}: its show is checked and dances.")
    said += _write_choice(folders.data, choice, seen)
    return Outcome(choice._replace(refused=tuple(refused)), taken, tuple(said))


def _take(
    folders: BoxFolders, arrival: Arrival, choice: Choice, check: Check
) -> tuple[ShowAndBox | None, list[str], bool]:
    """The pair to dance from now on, what is wrong, and whether that is the arrival's fault for good."""
    from appliance.release.shelf import NoRoomError, Shelf, UnreadableError

    no_room = ""
    # In memory where the disk takes nothing: then a stick may be pulled in mid-show.
    for root in (folders.data, folders.run):
        shelf = Shelf(root)
        try:
            shelf.sweep((choice, Choice.read(folders.run / CHOSEN) or Choice()))
            newest, problems = _on_shelf(shelf, folders, arrival, choice, check)
        except UnreadableError as error:
            cure = "Was it pulled? Plug it in again, or copy the show again."
            return None, [_printable(f"{arrival.label.capitalize()}: {error} {_GOES_ON} {cure}")], False
        except NoRoomError as error:
            no_room = (
                f"{arrival.label.capitalize()}: no room for its show ({error}). {_GOES_ON} Free some room."
            )
        else:
            return newest, problems, root == folders.data
    return None, [_printable(no_room)], False


def _on_shelf(
    shelf: Shelf, folders: BoxFolders, arrival: Arrival, choice: Choice, check: Check
) -> tuple[ShowAndBox | None, list[str]]:
    before = (choice.pairs or (ShowAndBox(),))[0]
    show_id, show = shelf.take_show(arrival) if arrival.show else (before.show_id, before.show)
    box_id, original = shelf.take_box(arrival) if arrival.box else (before.box_id, before.box)
    copies = {str(show): str(arrival.show), str(original): str(arrival.box)}
    first_problems: list[str] = []
    for with_show, with_box in _combinations(arrival):
        danced = (show_id, show) if with_show else (before.show_id, before.show)
        boxed = (box_id, original) if with_box else (before.box_id, before.box)
        if problems := check(danced[1], boxed[1]):
            first_problems = first_problems or [_as_on_the_stick(message, copies) for message in problems]
            continue
        if with_box:
            boxed = (box_id, shelf.furnish(original, folders.moved))
        source = _named(arrival, with_show, with_box)
        return ShowAndBox(danced[1], boxed[1], f"{danced[0]}+{boxed[0]}", source), first_problems
    named = _named(arrival, arrival.show is not None, arrival.box is not None)
    return None, [*first_problems, f"Refused: {named}. {_GOES_ON}"]


def _combinations(arrival: Arrival) -> Iterator[tuple[bool, bool]]:
    """Both together; else only the show, else only the box file: a broken one does not hold up both."""
    if arrival.show and arrival.box:
        yield True, True
    if arrival.show:
        yield True, False
    if arrival.box:
        yield False, True


def _named(arrival: Arrival, with_show: bool, with_box: bool) -> str:
    what = "show and box file" if with_show and with_box else "show" if with_show else "box file"
    return f"{what} from {arrival.label}"


def _as_on_the_stick(message: str, copies: dict[str, str]) -> str:
    """The path that people find on their stick, not the copy that was checked."""
    for copy, source in copies.items():
        message = message.replace(copy, source)
    return _printable(message)


def _printable(message: str) -> str:
    """A file's name may be no text; these words must be printable everywhere."""
    return message.encode("utf-8", "backslashreplace").decode()


def _write_choice(data: Path, choice: Choice, seen: dict[str, Any]) -> list[str]:
    try:
        if choice.pairs:
            choice._replace(refused=(), data=data).write(data / CHOSEN)
        write_whole(data / SEEN, json.dumps(seen).encode())
        _write_refusals(data / "refusals", seen)
    except OSError as error:
        return [
            f"{data}: nothing can be kept there ({error.strerror}). The show dances tonight; after the next "
            "power-on the last one that could be kept does. Look at the data partition."
        ]
    return []


def _write_refusals(folder: Path, seen: dict[str, Any]) -> None:
    folder.mkdir(mode=0o700, exist_ok=True)
    for source, one in seen.items():
        path = folder / f"{source}.txt"
        if one["refused"]:
            write_whole(path, "".join(f"{message}\n" for message in one["refused"]).encode())
        else:
            path.unlink(missing_ok=True)


def _is_new(arrival: Arrival, seen: dict[str, Any], lost: set[str]) -> bool:
    """Another one than at the last look, or what was taken then is lost."""
    one = seen.get(arrival.source)
    return one is None or one["listing"] != arrival.listing or one["taken"] in lost


def _lost(data: Path, seen: dict[str, Any]) -> set[str]:
    """Ids of installed bundles that are missing on disk. Bundles pruned for newer ones do not count."""
    saved = Choice.read(data / CHOSEN)
    if saved is None:
        return {one["taken"] for one in seen.values() if one["taken"]}
    return {one.id for one in saved.pairs if one.id and not one.here().is_there}


def _seen(arrival: Arrival, refused: list[str], taken: str) -> dict[str, Any]:
    return {"listing": arrival.listing, "refused": refused, "taken": taken}


def _read_seen(data: Path) -> dict[str, Any]:
    try:
        seen = stored_json(data / SEEN)
        return {
            str(source): {
                "listing": one["listing"],
                "refused": [str(message) for message in one["refused"]],
                "taken": str(one["taken"]),
            }
            for source, one in seen.items()
        }
    except (OSError, ValueError, TypeError, AttributeError, KeyError):
        return {}


def built_in_box(folders: BoxFolders) -> Path:
    """The box file for a box without one: as it comes, or with its folders elsewhere. Raises OSError."""
    if not folders.moved:
        return APPLIANCE_BOX
    path = folders.run / "box.yaml"
    write_whole(path, appliance_box(folders.moved).encode())
    return path
