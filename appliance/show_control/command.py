"""Commands: which addresses the box takes, with which arguments, within which bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from appliance.levers.addresses import FORMS
from appliance.levers.form import Form
from appliance.show.config_error import nearest
from appliance.show_control.packet import Unread, is_readable

REPLY, SENSORS_REPLY, PONG = "/reply", "/sensors/reply", "/pong"  # what the box answers with
STREAMS = ("/player/", "/mocap/")  # answered only when refused or not carried out
LONGEST_NAME = 100


@dataclass(frozen=True, slots=True)
class Command:
    """One message in a valid form. `text`: what it is about, a joint also by number; "": left out.

    also: a second name. saved: names of motions that were kept, which /phrase may call as well.
    """

    address: str
    values: tuple[float, ...] = ()
    text: str | int = ""
    saved: tuple[str, ...] = ()
    also: str = ""


def reply_to(address: str) -> str:
    return SENSORS_REPLY if address.startswith("/sensors/") else REPLY


def command(address: str, arguments: Sequence[object]) -> Command:
    """The command in one message. Raises ValueError with one clear sentence."""
    if address == "/panic":  # with any arguments; a single 0 is a button that is let go
        return Command(address, (0.0,) if list(arguments) == [0] else ())
    if not is_readable([address, *arguments]):
        raise ValueError("A command has no control characters in it.")
    form = FORMS.get(address)
    if form is None:
        near = nearest(address, list(FORMS))
        meant = f"Did you mean {near}?" if near else "docs/osc.md lists what it takes."
        raise ValueError(f"{address[:LONGEST_NAME]} is no command of this box. {meant}")
    require_read(address, arguments)
    also = ""
    if form.also:
        also = str(_name(form, arguments[1]) or "") if len(arguments) > 1 else ""
        arguments = [*arguments[:1], *arguments[2:]]
    text, numbers = _text(form, arguments)
    if text is None or bool(form.also) != bool(also) or not form.admits(numbers):
        raise ValueError(f"{address} takes {form.syntax()}.")
    return Command(address, tuple(float(number) for number in numbers), text, also=also)


def require_read(address: str, arguments: Sequence[object]) -> None:
    """Refuse a message that was not read whole. Raises ValueError with one clear sentence."""
    for one in arguments:
        if isinstance(one, Unread):
            tag = f"with OSC type {one.tag}" if one.tag.isalnum() else "that cannot be read"
            raise ValueError(
                f"{address} came with an argument {tag}: nothing is changed. Send numbers as i or f, and "
                "texts as s."
            )


def _text(form: Form, arguments: Sequence[object]) -> tuple[str | int | None, list[int | float]]:
    """The command's subject (None: not given), and its numbers."""
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
