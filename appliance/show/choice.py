"""Which show dances tonight, on which box file, and what dances instead when it does not."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

APPLIANCE_BOX = Path(__file__).resolve().parent / "appliance_box.yaml"
EMBEDDED_SHOW = Path(__file__).resolve().parent / "default_show"
BOOTS = (Path("/boot/firmware/bunraku"), Path("/boot/bunraku"))
STICK = Path("/media/bunraku/bunraku")
DATA = Path("/data/bunraku")
RUN = Path("/run/bunraku")
CHOSEN = "chosen.json"


@dataclass(frozen=True, slots=True)
class Pair:
    """A show and a box file that were checked together. id: "" for what comes with the box."""

    show: Path = EMBEDDED_SHOW
    box: Path = APPLIANCE_BOX
    id: str = ""
    source: str = "comes with the box"


@dataclass(frozen=True, slots=True)
class Choice:
    """pairs: in the order in which they are tried; the last one comes with the box.

    refused: what was found and is not danced, sentences for people.
    """

    pairs: tuple[Pair, ...] = (Pair(),)
    refused: tuple[str, ...] = ()

    @property
    def first(self) -> Pair:
        """What dances."""
        return self.pairs[0]

    @staticmethod
    def read(path: Path) -> Choice | None:
        """As written; None where there is none, or no whole one."""
        try:
            values: dict[str, Any] = json.loads(path.read_bytes())
            pairs = tuple(_pair(one) for one in values["pairs"])
            return Choice(pairs or (Pair(),), tuple(map(str, values["refused"])))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def text(self) -> str:
        """As JSON: the pairs, and what dances once more at the top for scripts."""
        pairs = [_plain(pair) for pair in self.pairs]
        return json.dumps({**pairs[0], "pairs": pairs, "refused": list(self.refused)}, indent=1) + "\n"


def _pair(values: dict[str, Any]) -> Pair:
    return Pair(Path(values["show"]), Path(values["box"]), str(values["id"]), str(values["source"]))


def _plain(pair: Pair) -> dict[str, str]:
    return {name: str(value) for name, value in asdict(pair).items()}


def boots(paths: Sequence[Path] = BOOTS) -> Path:
    """The boot partition's folder for shows: the first of them that is there."""
    return next((path for path in paths if path.is_dir()), paths[-1])
