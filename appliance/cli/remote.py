"""`bunraku remote`: timecode and MIDI of the house, given to show control."""

from __future__ import annotations

from appliance.cli.options import BoxFile, ChosenFile
from appliance.release.choice import box_of
from appliance.show.asked_for import require_remote


def remote(box: BoxFile = None, chosen: ChosenFile = None) -> None:
    """Hear timecode (Art-Net, MIDI, LTC) and MIDI controllers, and give show control commands."""
    path = box_of(box, chosen)
    require_remote(path)
    from appliance.remote.run import run_remote

    run_remote(path)
