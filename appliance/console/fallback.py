"""The page's fallbacks: when strangers crowd it, and when they try PINs."""

from __future__ import annotations

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
OF_THE_PAGE = (CROWDED, PIN_CHANGED)


def note_crowd(fallbacks: Fallbacks, address: str) -> None:
    """Strangers give way, most of them from this address; "": not any more."""
    fallbacks.concern(CROWDED.name, filter(None, [address]))
    fallbacks.set(CROWDED.name, bool(address))
