"""Commands: which addresses the box takes, with which arguments, within which bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from appliance.show.config_error import nearest
from appliance.show.sources import MOST_POINTS, PARAMETERS, SEEDS
from appliance.show_control.packet import Unread, is_readable

REPLY, SENSORS_REPLY, PONG = "/reply", "/sensors/reply", "/pong"  # what the box answers with
STREAMS = ("/player/", "/mocap/")  # answered only when refused or not carried out
LONGEST_NAME = 100
_MOST_FADE_S = 60.0
_FAR = 1e6
_MOST_SAID = 4  # optional numbers in an error


class Number(NamedTuple):
    """One number that a command takes."""

    what: str
    least: float
    most: float
    is_whole: bool = False

    def admits(self, given: float) -> bool:
        """Whether it is finite and within the bounds."""
        return self.least <= given <= self.most and not (self.is_whole and given % 1)

    def __str__(self) -> str:
        if self.is_whole and self.most - self.least == 1:
            return f"{self.least:g} or {self.most:g}"
        bounds = f"{self.least:g} to {self.most:g}" if self.most < _FAR else f"from {self.least:g}"
        return f"{self.what} ({bounds})" if abs(self.least) < _FAR else self.what


class Form(NamedTuple):
    """What an address takes: `text` says what its first argument names (empty: nothing), then numbers.

    may_be_nameless: the text may be left out. optional: how many of the last numbers may be left out.
    """

    text: str = ""
    numbers: tuple[Number, ...] = ()
    optional: int = 0
    may_be_nameless: bool = False

    def words(self) -> str:
        """What it takes, for people."""
        text = f"[{self.text}]" if self.text and self.may_be_nameless else self.text
        fewest = len(self.numbers) - self.optional
        parts = [*([text] if text else []), *map(str, self.numbers[:fewest])]
        parts += [f"[{number}]" for number in self.numbers[fewest:][:_MOST_SAID]]
        parts += ["..."] if self.optional > _MOST_SAID else []
        return ", ".join(parts) or "nothing"


_ON = Number("0 or 1", 0, 1, is_whole=True)
_FADE = Number("fade in seconds", 0, _MOST_FADE_S)
_SECOND = Number("second", 0, _FAR)
_ANY = -_FAR, _FAR
_WIND = tuple(Number(f"{axis}, m/s", -30, 30) for axis in "xyz")
_CORNER = Number("corner", 1, 4, is_whole=True)
_PLACE = (Number("x", -0.5, 1.5), Number("y", -0.5, 1.5))  # as far as keys move a corner
_POINT = (Number("x", 0, 1), Number("y", 0, 1))
_METRES = tuple(Number(f"{axis} in metres", *_ANY) for axis in "xyz")
_STAND = (
    Number("angle in degrees", -180, 180),
    Number("elevation in degrees", -3, 70),
    Number("figure", 0.1, 0.9),
)
_WAY = (Number("dx", -1, 1), Number("dy", -1, 1))

FORMS: dict[str, Form] = {
    "/go": Form(numbers=(_ON,), optional=1),
    "/stop": Form(numbers=(_FADE,), optional=1),
    "/panic": Form(numbers=(_ON,), optional=1),
    "/blackout": Form(numbers=(_ON,)),
    "/master": Form(numbers=(Number("brightness", 0, 1), _FADE), optional=1),
    "/cue": Form("cue", may_be_nameless=True),
    "/phrase": Form("phrase", (_FADE,), optional=1),
    "/motion/path": Form(numbers=_POINT * MOST_POINTS, optional=2 * MOST_POINTS),
    "/motion/again": Form(),
    "/motion/keep": Form("name"),
    "/motion": Form(),
    **{
        f"/motion/{source}/{name}": Form(numbers=(Number(name, *about[2:]), _FADE), optional=1)
        for source, parameters in PARAMETERS.items()
        for name, about in parameters.items()
    },
    "/look": Form("look", (_FADE,), optional=1),
    "/card": Form("card", (_FADE,), optional=1),
    "/camera": Form(numbers=(*_STAND, _FADE), optional=1),
    "/camera/look": Form(numbers=(_FADE,), optional=1),
    "/lights": Form("light mappings", (_FADE,), optional=1),
    "/lights/walk": Form("fixture", may_be_nameless=True),
    "/lights/walk/stop": Form(),
    "/strings": Form(numbers=(Number("loudness", 0, 1), _FADE), optional=1),
    "/springs": Form("setting", (_FADE,), optional=1),
    "/springs/stiffness": Form(numbers=(Number("times the setting's", 0.1, 10), _FADE), optional=1),
    "/springs/storm": Form(numbers=(Number("strength", 0, 1), _FADE), optional=1),
    "/springs/feedback": Form(numbers=(Number("gain", 0, 1), _FADE), optional=1),
    "/springs/wind": Form(numbers=_WIND),
    "/springs/gravity": Form(numbers=(Number("downwards, m/s^2", -20, 20),)),
    "/springs/kick": Form(numbers=_WIND),
    "/iterations": Form(numbers=(Number("coding", 0, 64, True), Number("interaction", 0, 64, True))),
    "/liveliness": Form(numbers=(Number("liveliness", 0, 1), _FADE), optional=1),
    "/seed": Form(numbers=(Number("seed", 0, SEEDS - 1, True),)),
    "/hold": Form("joint", (_ON,)),
    "/ping": Form(),
    "/status": Form(),
    "/cues": Form(),
    "/phrases": Form(),
    "/looks": Form(),
    "/cards": Form(),
    "/hands": Form(),
    "/fallbacks": Form(),
    "/projector/corner": Form(numbers=(_CORNER, *_PLACE)),
    "/projector/corners": Form(numbers=_PLACE * 4),
    "/projector/corners/reset": Form(),
    "/projector/nudge": Form(numbers=(_CORNER, *_WAY)),
    "/projector/brightness": Form(numbers=(Number("brightness", 0, 2),)),
    "/projector/mirror": Form(numbers=(_ON,)),
    "/projector/grid": Form(numbers=(_ON,)),
    "/projector/info": Form(numbers=(_ON,)),
    "/player/start": Form(),
    "/player/stop": Form(),
    "/player/jump": Form(numbers=(_SECOND,)),
    "/player/rate": Form(numbers=(Number("rate", -4, 4),)),
    "/player/excerpt": Form(numbers=(Number("start", 0, _FAR), Number("end", 0, _FAR)), optional=1),
    "/mocap/setjointrot": Form("joint", tuple(Number(axis, *_ANY) for axis in ("x", "y", "z", "angle"))),
    "/mocap/setjointpos": Form("joint", (*_METRES, Number("seconds", 0.1, 3600)), optional=1),
    "/mocap/releasejoint": Form("joint"),
    "/sensors/neutral": Form("sensor", may_be_nameless=True),
    "/sensors/heading": Form("sensor", may_be_nameless=True),
    "/sensors/strobe": Form("sensor"),
    "/sensors/reload": Form(),
    "/sensors/list": Form(),
}


@dataclass(frozen=True, slots=True)
class Command:
    """One message in a valid form. `text`: what it is about, a joint also by number; "": left out.

    kept: names of motions that were kept, which /phrase may call as well.
    """

    address: str
    values: tuple[float, ...] = ()
    text: str | int = ""
    kept: tuple[str, ...] = ()


def command(address: str, arguments: Sequence[object]) -> Command:
    """The command in one message. Raises ValueError with one clear sentence."""
    if address == "/panic":  # with any arguments; 0 alone is a button that is let go
        return Command(address, (0.0,) if list(arguments) == [0] else ())
    if not is_readable([address, *arguments]):
        raise ValueError("A command has no control characters in it.")
    form = FORMS.get(address)
    if form is None:
        near = nearest(address, list(FORMS))
        meant = f"Did you mean {near}?" if near else "docs/osc.md lists what it takes."
        raise ValueError(f"{address[:LONGEST_NAME]} is no command of this box. {meant}")
    require_read(address, arguments)
    text, numbers = _text(form, arguments)
    if text is None or not _fit(form, numbers):
        raise ValueError(f"{address} takes {form.words()}.")
    return Command(address, tuple(float(number) for number in numbers), text)


def require_read(address: str, arguments: Sequence[object]) -> None:
    """Refuse a message that was not read whole. Raises ValueError with one clear sentence."""
    for one in arguments:
        if isinstance(one, Unread):
            tag = f"of the OSC type {one.tag}" if one.tag.isalnum() else "that cannot be read"
            raise ValueError(
                f"{address} came with an argument {tag}: nothing is changed. Send numbers as i or f, and "
                "texts as s."
            )


def _text(form: Form, arguments: Sequence[object]) -> tuple[str | int | None, list[int | float]]:
    """What the command is about (None: not given), and its numbers."""
    text: str | int | None = ""
    if form.text and arguments:
        text, arguments = _name(form, arguments[0]), arguments[1:]
    elif form.text and not form.may_be_nameless:
        text = None
    numbers = [one for one in arguments if isinstance(one, int | float)]
    return (text if len(numbers) == len(arguments) else None), numbers


def _name(form: Form, given: object) -> str | int | None:
    """A name; for joints also a number; desks that number their cues may send 3 for the cue `3`."""
    if isinstance(given, str):
        return given if 0 < len(given) <= LONGEST_NAME else None
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        return None
    if form.text == "cue":
        return f"{given:g}"
    return given if form.text == "joint" and isinstance(given, int) else None


def _fit(form: Form, numbers: Sequence[int | float]) -> bool:
    """Whether these are as many as it takes, finite, and within the bounds."""
    if not len(form.numbers) - form.optional <= len(numbers) <= len(form.numbers):
        return False
    return all(wanted.admits(given) for wanted, given in zip(form.numbers, numbers, strict=False))
