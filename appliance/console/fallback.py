"""The page's fallbacks: strangers crowd it or try PINs, a phone sends nonsense, reports do not arrive."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.box.fallback import Fallback, Fallbacks

_CROWDED = (
    "so many connections to the page without the PIN that the oldest are closed. The dance goes on, and "
    "devices that gave the PIN keep the page and their commands. "
)
CROWDED = Fallback(
    "page-crowded",
    f"Strangers hold {_CROWDED}Narrow `console: viewers` in the box file to the technicians' network.",
    f"{{about}} holds {_CROWDED}Find that device, or leave its address out of `console: viewers` in the box "
    "file.",
)
PIN_CHANGED = Fallback(
    "pin-changed",
    "So many wrong PINs came to the page that it chose a longer one. The dance goes on, and devices that "
    "gave the PIN before go on too. A new device finds it on the test card, or by: bunraku console pin.",
)
_NONSENSE = (
    "no numbers, too many a second, or by a clock that runs back. They were dropped, and the joint is given "
    "back where no others come. Open the page on that phone again."
)
PHONE_REFUSED = Fallback(
    "phone-refused",
    f"A phone in place of a sensor sent readings with {_NONSENSE}",
    f"The phone that is {{about}} sent readings with {_NONSENSE}",
)
_UNSENT = (
    "did not arrive, and is tried again, at last every five minutes. The dance goes on. See whether the box "
    "reaches the internet, and `console: report` in the box file."
)
UNSENT = Fallback("report-unsent", f"A report {_UNSENT}", f"A report by {{about}} {_UNSENT}")
OF_THE_PAGE = (CROWDED, PIN_CHANGED, PHONE_REFUSED, UNSENT)


def note_unsent(fallbacks: Fallbacks, ways: Sequence[str]) -> None:
    """Reports by these ways have not arrived; [] all have."""
    fallbacks.concern(UNSENT.name, ways)
    fallbacks.set(UNSENT.name, bool(ways))


def note_crowd(fallbacks: Fallbacks, address: str) -> None:
    """Strangers give way, most of them from this address; "": not any more."""
    fallbacks.concern(CROWDED.name, filter(None, [address]))
    fallbacks.set(CROWDED.name, bool(address))
