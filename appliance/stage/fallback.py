"""The stage's fallbacks: what it does when something goes wrong; `watch.py` notices it."""

from __future__ import annotations

from appliance.box.fallback import Fallback

SENSOR_SILENT = Fallback(
    "sensor-silent",
    "A sensor was silent for 0.1 s: its joint holds, then moves freely over a second, and is taken again "
    "over half a second when readings return. Check its battery, then the network.",
    "No readings from {about} for 0.1 s: the joint holds, then moves freely over a second, and is taken "
    "again over half a second when readings return. Check the battery of {about}, then the network.",
)
READING_REFUSED = Fallback(
    "reading-refused",
    "Readings without an orientation were dropped. The audience sees nothing of it. Our firmware sends none: "
    "if it goes on, flash that wearable with the firmware of this version.",
    "Readings of {about} without an orientation were dropped. The audience sees nothing of it. Our firmware "
    "sends none: if it goes on, flash {about} with the firmware of this version.",
)
PACKET_REFUSED = Fallback(
    "packet-refused",
    "Datagrams that are none of our sensors' were dropped. The audience sees nothing of it. If it goes on, "
    "another device is in the sensors' network.",
    "Datagrams from {about}, which are none of our sensors', were dropped. The audience sees nothing of it. "
    "If it goes on, see which device has that address in the sensors' network.",
)
CABLE_AWAY = Fallback(
    "cable-away",
    "A sensor's cable is unplugged: its joint moves freely. It is taken again when it is plugged in.",
    "The sensor's cable {about} is unplugged: its joint moves freely. It is taken again when it is plugged "
    "in.",
)
ADDRESS_ABSENT = Fallback(
    "address-absent",
    "This machine lacks the address at which it listens to sensors: joints move freely until it comes. "
    "Look at the network's cable or access point, then at sensors: udp: in the box file.",
    "This machine lacks the address {about}, at which it listens to sensors: joints move freely until it "
    "comes. Look at the network's cable or access point, then at sensors: udp: in the box file.",
)
NOT_LET_IN = Fallback(
    "sensor-not-let-in",
    "A sensor of the show has no key here: its joint moves freely. Provision it.",
    "No key here for {about} of the show: the joint moves freely. Provision it (bunraku provision --name), "
    "or give a spare its name.",
)
TICK_LATE = Fallback(
    "tick-late",
    "A tick was late: the last pose left once more. The audience sees nothing of one, a tremble of many. "
    "Check what else uses the processor: bunraku doctor.",
)
TICK_SKIPPED = Fallback(
    "tick-skipped",
    "Slots went by without a frame: the machine was held up. The dance goes on in its place. Check what else "
    "uses the processor: bunraku doctor.",
)
OVER_BUDGET = Fallback(
    "over-budget",
    "A tick cost more than its budget. The audience sees nothing of it while frames leave in time. Lower the "
    "iterations if it happens often.",
)
ITERATIONS_LOWERED = Fallback(
    "iterations-lowered",
    "The show's iterations do not fit this machine and are lowered: the dancer follows the phrase more "
    "closely.",
)
NETWORK_FAILED = Fallback(
    "network-not-finite",
    "The network gave poses that are not numbers: the last good pose is held. Copy the show bundle again.",
)
FIGURE_REFUSED = Fallback(
    "figure-impossible",
    "A figure came out with numbers that no stage has, and did not leave the box: the last good frame stayed "
    "and the dance goes on from its phrase. Export the journal for us: bunraku journal export.",
)
RECEIVER_GONE = Fallback(
    "receiver-gone",
    "A receiver does not get the dance; the others do, and it is tried again each second. Start it, or check "
    "its address.",
    "Receiver {about} does not get the dance; the others do, and it is tried again each second. Start it, or "
    "check its address.",
)
NOT_REALTIME = Fallback(
    "not-realtime",
    "The stage has no real-time rights: other programs can hold it up. Run bunraku doctor for the cure.",
)
NOT_SHARED = Fallback(
    "frames-not-shared",
    "Frames cannot be shared: neither lights nor projector see the dance. Free memory in the runtime folder.",
)
NOT_RECORDED = Fallback(
    "journal-missing",
    "The journal cannot be recorded. The audience sees nothing of it. Free memory in the runtime folder.",
)
PLACE_NOT_NOTED = Fallback(
    "place-not-noted",
    "The place of the dance cannot be noted: after a crash it begins at the beginning. Free memory in the "
    "runtime folder.",
)
STAGE_RESTARTED = Fallback(
    "stage-restarted",
    "The stage hung or died and was started again: outputs paused, and the dance went on where it was. "
    "Export the journal for us: bunraku journal export.",
)
POWER_CUT = Fallback(
    "power-cut",
    "The power was cut: the dance went on where it was, less than a second before. Check the plug.",
)
PLACE_DROPPED = Fallback(
    "place-dropped",
    "The place where the dance stood was damaged, or held numbers that no stage has: it was dropped. The "
    "show went on from the last sound place, or began at the beginning. Export the journal for us: bunraku "
    "journal export.",
)
SOURCE_LATE = Fallback(
    "source-late",
    "What the puppet was to start from did not come in time: the last phrase plays on, and the source takes "
    "over again when it is back. Of a live dancer check the program that sends it, and the network; of vary, "
    "granular, path and improvise the generator: journalctl -u bunraku-generator.",
    "What the puppet was to start from did not come in time ({about}): the last phrase plays on, and the "
    "source takes over again when it is back. Of a live dancer check the program that sends it, and the "
    "network; of vary, granular, path and improvise the generator: journalctl -u bunraku-generator.",
)
POSE_REFUSED = Fallback(
    "pose-refused",
    "Poses of a live dancer were refused: another number of joints, or invalid rotations. The figure "
    "goes on from the last good one, and after half a second from the phrase. Check the skeleton in the "
    "program that sends it.",
)
SOURCE_JUMPED = Fallback(
    "source-jumped",
    "The root of a live dancer jumped farther than anybody moves: the figure goes on from where it stood. "
    "Check the tracking in the program that sends it.",
)
FOLDER_LOST = Fallback(
    "folder-lost",
    "The folder where the box's processes meet was deleted, or files in it. The audience saw nothing of it: "
    "it was made again, with what is in force. Find what deletes it: a cleaner of temporary files, or a "
    "person.",
)
PAIR_ALONE = Fallback(
    "pair-alone",
    "The pair's other box is not heard, or cannot follow: the show goes on, and nobody would take over. "
    "Switch it on; look at the cable between the boxes.",
)
PAIR_TAKEN = Fallback(
    "pair-taken",
    "The other box was silent, and this one took over, as a rule within a frame. Look at the other box; "
    "it follows once it is back, and `bunraku pair back` gives it the lead again.",
)
OUT_OF_STEP = Fallback(
    "out-of-step",
    "A box that should dance in step with this one is not heard, or has another show: each dances by itself. "
    "Switch it on; look at the cable, and at `locked:` in both box files.",
)
OF_THE_STAGE = (
    *(SENSOR_SILENT, READING_REFUSED, PACKET_REFUSED, CABLE_AWAY, ADDRESS_ABSENT, NOT_LET_IN),
    *(TICK_LATE, TICK_SKIPPED, OVER_BUDGET, ITERATIONS_LOWERED, NETWORK_FAILED, FIGURE_REFUSED),
    *(
        RECEIVER_GONE,
        NOT_REALTIME,
        NOT_SHARED,
        NOT_RECORDED,
        PLACE_NOT_NOTED,
        PLACE_DROPPED,
        STAGE_RESTARTED,
        POWER_CUT,
        SOURCE_LATE,
        POSE_REFUSED,
        SOURCE_JUMPED,
        FOLDER_LOST,
        PAIR_ALONE,
        PAIR_TAKEN,
        OUT_OF_STEP,
    ),
)
