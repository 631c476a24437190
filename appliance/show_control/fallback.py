"""Show control's fallbacks about what comes in at its port."""

from __future__ import annotations

from appliance.box.fallback import Fallback

COMMAND_FAILED = Fallback(
    "command-failed",
    "A command ended in an error of this program: it may be half done. The dance and all other commands go "
    "on. Send us the lines of: journalctl -u bunraku-control.",
    "The command {about} ended in an error of this program: it may be half done. The dance and all other "
    "commands go on. Send us the lines of: journalctl -u bunraku-control.",
)
SENDER_NOT_LISTED = Fallback(
    "sender-not-listed",
    "Datagrams at the control port came from an address that is not listed, and were dropped. Nothing is "
    "changed. To let it: `senders` under control in the box file.",
    "Datagrams at the control port came from {about}, which is not listed, and were dropped. Nothing is "
    "changed. To let it: `senders` under control in the box file.",
)
LIVE_DROPPED = Fallback(
    "live-dropped",
    "The datagrams of a live dancer came faster than they can be read: the oldest gave way, and the figure "
    "follows with gaps. Lower the rate in the program that sends them.",
)
LIVE_REFUSED = Fallback(
    "live-refused",
    "Datagrams of a live dancer were refused: the figure does not follow them. Check the program that sends "
    "them.",
    "Datagrams of a live dancer were refused: {about}",
)
LIVE_PARTIAL = Fallback(
    "live-partial",
    "A live dancer comes without some bones: these stay with the phrase. Check what the program that sends "
    "it tracks.",
    "Of a live dancer {about}: the others stay with the phrase. Check what the program that sends it tracks.",
)
OF_CONTROL = (COMMAND_FAILED, SENDER_NOT_LISTED, LIVE_DROPPED, LIVE_REFUSED, LIVE_PARTIAL)
