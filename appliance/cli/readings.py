"""The fate of the sensors' packets, in a line at the end of a run."""

from __future__ import annotations

_NO_REFUSAL = ("accepted", "hello", "profile", "lost", "reboot", "drain_limit")
# In a technician's words; a reason that is missing here keeps its name from docs/wire.md.
_REFUSALS = {
    "no packets of ours": ("length", "magic", "version", "kind"),
    "from sensors without a key": ("device",),
    "forged or damaged": ("tag",),
    "from an earlier link": ("old_session", "old_hello"),
    "doubled or too late": ("duplicate", "reordered", "old"),
    "without an orientation": ("norm",),
    "damaged on the cable": ("frame_length", "frame_stuffing", "frame_crc"),
}


def readings_line(counts: dict[str, int]) -> str:
    """Counts of the sensors' packets: accepted, lost, refused by reason."""
    meanings = {reason: meaning for meaning, reasons in _REFUSALS.items() for reason in reasons}
    refused: dict[str, int] = {}
    for reason, count in counts.items():
        if count and reason not in _NO_REFUSAL:
            said = meanings.get(reason, reason)
            refused[said] = refused.get(said, 0) + count
    lost = f", {counts['lost']} lost on the way" if counts["lost"] else ""
    reasons = ", ".join(f"{count} {said}" for said, count in refused.items())
    return f"Readings: {counts['accepted']} accepted{lost}" + (f"; refused: {reasons}." if refused else ".")
