"""Which show dances tonight, on which box file, and what dances instead when it does not."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.durable import write_whole
from appliance.pose.foreign_file import stored_json

_SHOWS = Path(__file__).resolve().parents[1] / "show"
APPLIANCE_BOX, EMBEDDED_SHOW = _SHOWS / "appliance_box.yaml", _SHOWS / "default_show"
BOOTS = (Path("/boot/firmware/bunraku"), Path("/boot/bunraku"))
STICK = Path("/media/bunraku/bunraku")
DATA = Path("/data/bunraku")
RUN = Path("/run/bunraku")
CHOSEN = "chosen.json"
_MOST_REMEMBERED = 2  # the newest and the last good one; what comes with the box is always there


class ShowAndBox(NamedTuple):
    """A show and a box file that were checked together.

    id: of their contents, `show+box`, where nothing stands for what comes with the box; source: where they
    came from, for people; good: the pair has danced on this box.
    """

    show: Path = EMBEDDED_SHOW
    box: Path = APPLIANCE_BOX
    id: str = ""
    source: str = "comes with the box"
    good: bool = False

    @property
    def show_id(self) -> str:
        """Only about the show."""
        return self.id.partition("+")[0]

    @property
    def box_id(self) -> str:
        """Only about the box file."""
        return self.id.partition("+")[2]

    def here(self, box: Path = APPLIANCE_BOX) -> ShowAndBox:
        """With what comes with the box as it comes with this release, which may be another one now."""
        return self._replace(
            show=self.show if self.show_id else EMBEDDED_SHOW, box=self.box if self.box_id else box
        )

    @property
    def is_there(self) -> bool:
        """Whether both can still be found, on a disk that may be gone or another one."""
        try:
            return (self.show / "show.yaml").is_file() and self.box.is_file()
        except OSError:
            return False


class Aside(NamedTuple):
    """A pair that did not dance, by its id; message: a sentence about it, for people."""

    id: str
    message: str


class Choice(NamedTuple):
    """pairs: in the order in which they are tried, never empty in a file that a stage reads.

    refused: what was found and is not danced, sentences for people; aside: the pairs that did not dance;
    data: the folder in which it is kept over power-off.
    """

    pairs: tuple[ShowAndBox, ...] = (ShowAndBox(good=True),)
    refused: tuple[str, ...] = ()
    aside: tuple[Aside, ...] = ()
    data: Path = DATA

    @property
    def first(self) -> ShowAndBox:
        """The current choice."""
        return self.pairs[0]

    @staticmethod
    def read(path: Path) -> Choice | None:
        """As written; None where there is none, no whole one, or an empty one."""
        try:
            choice = Choice.of(stored_json(path))
        except (OSError, ValueError):
            return None
        return choice if choice.pairs else None

    @staticmethod
    def of(values: dict[str, Any]) -> Choice:
        """From plain values; raises ValueError."""
        try:
            refused = tuple(map(str, values["refused"]))
            aside = tuple(Aside(*map(str, one)) for one in values["aside"])
            pairs = tuple(_show_and_box(one) for one in values["pairs"])
            return Choice(pairs, refused, aside, Path(values["data"]))
        except (KeyError, TypeError) as error:
            raise ValueError(f"This is no choice of a show ({error}).") from error

    def plain(self) -> dict[str, Any]:
        pairs = [pair._asdict() | {"show": str(pair.show), "box": str(pair.box)} for pair in self.pairs]
        lists = {"pairs": pairs, "refused": list(self.refused), "aside": list(self.aside)}
        return lists | {"data": str(self.data)}

    def write(self, path: Path) -> None:
        """Atomic, even during a power cut; the current choice is also the first entry.

        Raises OSError.
        """
        values = self.plain()
        write_whole(path, (json.dumps({**values["pairs"][0], **values}, indent=1) + "\n").encode())

    def with_newest(self, pair: ShowAndBox) -> Choice:
        """To remember: this one first, then the newest of those that have danced."""
        others = [one for one in self.pairs if one.id and one.id != pair.id]
        good = [one for one in others if one.good] or others
        has_danced = pair.good or any(one.good for one in self.pairs if one.id == pair.id)
        return Choice((pair._replace(good=has_danced), *good[: _MOST_REMEMBERED - 1]))

    def with_good(self, identity: str) -> Choice:
        """This pair has danced."""
        return self._replace(
            pairs=tuple(one._replace(good=True) if one.id == identity else one for one in self.pairs)
        )

    def without(self, other: Choice) -> Choice:
        """Without pairs that did not dance, as another choice tells; what comes with the box stays.

        So does what has danced on this box: that it does not tonight may be tonight's fault.
        """
        good = {one.id for one in self.pairs if one.good}
        aside = {one.id: one for one in (*self.aside, *other.aside) if one.id not in good}
        if not aside:
            return self
        pairs = tuple(one for one in self.pairs if not one.id or one.id not in aside)
        return self._replace(pairs=pairs or (ShowAndBox(good=True),), aside=tuple(aside.values()))

    def complete(self, box: Path = APPLIANCE_BOX) -> Choice:
        """With what comes with the box at the end, on the venue's box files first: never nothing on stage.

        `box`: the box file of a box without one.
        """
        pairs = {one.id: one.here(box) for one in self.pairs if one.id}
        pairs = {identity: one for identity, one in pairs.items() if one.is_there}
        for one in list(pairs.values()):
            if one.box_id:
                name = f"+{one.box_id}"
                pairs.setdefault(name, ShowAndBox(box=one.box, id=name, good=one.good))
        return self._replace(pairs=(*pairs.values(), ShowAndBox(box=box, good=True)))


def box_of(box: Path | None, chosen: Path | None) -> Path | None:
    """The box file that a command means with `--box` or `--chosen`; raises ConfigError for both."""
    if chosen is None:
        return box
    require_no("--box", box, chosen)
    choice = Choice.read(chosen)
    return choice.first.box if choice is not None else APPLIANCE_BOX


def files_named(given: Sequence[str]) -> tuple[Path | None, Path | None]:
    """The box file and the choice in the arguments that the page gives its child: `--box FILE` or
    `--chosen FILE`.
    """
    named = {name: Path(path) for name, path in zip(given[::2], given[1::2], strict=True)}
    return named.get("--box"), named.get("--chosen")


def require_no(option: str, given: Path | None, chosen: Path) -> None:
    """Raises ConfigError where a choice is given, and something else besides."""
    if given is not None:
        from appliance.show.config_error import ConfigError, Problem

        message = f"This names a show and a box file, and {option} another one."
        raise ConfigError([Problem(chosen, 0, message, f"Give {option} or --chosen, not both.")])


def appliance_box(places: dict[str, str]) -> str:
    """The box file that comes with the box, with folders other than the usual ones."""
    text = APPLIANCE_BOX.read_text(encoding="utf-8")
    for usual, place in places.items():
        text = text.replace(usual, place)
    return text


def _show_and_box(values: dict[str, Any]) -> ShowAndBox:
    show, box = Path(values["show"]), Path(values["box"])
    return ShowAndBox(show, box, str(values["id"]), str(values["source"]), bool(values["good"]))
