"""Lever: one thing that a desk, a cue or the page may set, and all that its users need to know of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, NamedTuple, TypeVar

from appliance.levers.fade import Fade
from appliance.levers.form import FADE, Form
from appliance.levers.kind import Formatted, Kind

T = TypeVar("T")

Follower = Literal["", "stage", "generator"]
AT_ONCE: float | None = None


class Need(NamedTuple):
    """A condition on the show: without it the lever moves nothing. among: an attribute of Facts.

    what: a name that has to be among them, and what it is called; empty: one of any name. cure: the error
    for a show without one.
    """

    among: str
    what: tuple[str, str] = ("", "")
    cure: str = ""


@dataclass(frozen=True, slots=True)
class Lever(Generic[T]):
    """A value that stays until it is set again.

    name: in the show state and in orders; a blank ends the name of a family, whose members have a value each
    (`hand lShldr`). default: before it is set. does: for people.
    address: OSC; empty: no address sets it directly. fade_s: how long a change takes where a command does not
    say; AT_ONCE: it takes no fade. is_faded_by_osc: whether the address takes one, or only cues do.
    cue: the key in a cue; empty: none. in_cue: its sentence in docs/configuration.md.
    follower: the process that has to follow before a command is answered; empty: all read it as they draw.
    names: attribute of Facts with the names that the show has, and what one is called. listed: the last word
    of the answer to the question for these names; empty: none asks. none: the word for no name at all.
    needs: see Need.
    stays: also when another show begins. ends: names of levers whose values a change of this one ends.
    said: what a command is answered with, for a value and seconds.
    """

    name: str
    kind: Kind[T]
    default: T
    does: str = ""
    address: str = ""
    fade_s: float | None = 0.0
    is_faded_by_osc: bool = True
    cue: str = ""
    in_cue: str = ""
    follower: Follower = ""
    names: tuple[str, str] = ("", "")
    listed: str = ""
    none: str = ""
    needs: Need | None = None
    stays: bool = False
    ends: tuple[str, ...] = ()
    said: Callable[[T, float], str] = lambda value, seconds: ""
    at_rest: Fade[T] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_rest", Fade(self.default, self.default))

    @property
    def family(self) -> str:
        """The name that orders have: without the member."""
        return self.name.partition(" ")[0]

    @property
    def form(self) -> Form:
        kind, has_fade = self.kind, self.fade_s is not AT_ONCE and self.is_faded_by_osc
        if has_fade:
            return Form(kind.text, (*kind.numbers, FADE), 1)
        return Form(kind.text, kind.numbers, kind.optional)

    def given(self, text: str, numbers: Sequence[float]) -> tuple[T, float]:
        """Value and seconds in the text and numbers of a message or an order."""
        value = self.kind.given(text, numbers)
        if self.fade_s is None:
            return value, 0.0
        own = len(self.kind.formatted(value)[1])
        return value, float(numbers[own]) if len(numbers) > own else self.fade_s

    def formatted(self, fade: Fade[T]) -> Formatted:
        """The other way round: the text and numbers of an order."""
        text, numbers = self.kind.formatted(fade.value)
        return text, numbers if self.fade_s is AT_ONCE else (*numbers, fade.seconds)


def at_once(fade: Fade[T]) -> Fade[T]:
    """The same, without its way."""
    return replace(fade, seconds=0.0)
