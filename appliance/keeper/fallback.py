"""The keeper's fallbacks: what cannot be kept on the disk, while the dance goes on."""

from __future__ import annotations

from appliance.box.fallback import Fallback

JOURNAL_STOPPED = Fallback(
    "journal-stopped",
    "The journal does not grow: the disk is full, read-only or gone. The audience sees nothing of it; the "
    "newest minute stays in memory, and the disk is tried each 10 s. Free some room, or check the disk.",
    "The journal does not grow: {about} is full, read-only or gone. The audience sees nothing of it; the "
    "newest minute stays in memory, and it is tried each 10 s. Free some room there, or check the disk.",
)
PLACE_NOT_SAVED = Fallback(
    "place-not-kept",
    "The place of the dance is not kept on the disk. The audience sees nothing of it, but after a power cut "
    "the dance begins where it was kept last. Free some room, or check the disk.",
    "The place of the dance is not kept on {about}. The audience sees nothing of it, but after a power cut "
    "the dance begins where it was kept last. Free some room there, or check the disk.",
)
SENSORS_NOT_SAVED = Fallback(
    "sensors-not-kept",
    "Neutral poses and calibrations are not kept on the disk. The audience sees nothing of it, but after a "
    "power cut sensors need a moment of stillness. Free some room, or check the disk.",
    "Neutral poses and calibrations are not kept on {about}. The audience sees nothing of it, but after a "
    "power cut sensors need a moment of stillness. Free some room there, or check the disk.",
)
GESTURES_NOT_SAVED = Fallback(
    "gestures-not-kept",
    "Recorded gestures are not kept on the disk. The audience sees nothing of it, but after a power cut "
    "today's are gone. Free some room, or check the disk.",
    "Recorded gestures are not kept on {about}. The audience sees nothing of it, but after a power cut "
    "today's are gone. Free some room there, or check the disk.",
)
CHOICE_NOT_SAVED = Fallback(
    "choice-not-kept",
    "That a show has danced, or has not, cannot be kept. The audience sees nothing of it; the show is tried "
    "again after the next power-on. Free some room, or check the disk.",
    "That a show has danced, or has not, cannot be kept on {about}. The audience sees nothing of it; the "
    "show is tried again after the next power-on. Free some room there, or check the disk.",
)
SAVED_IN_MEMORY = Fallback(
    "kept-in-memory",
    "This box keeps its data in memory: sensors' keys, neutral poses, shows from sticks and the journal are "
    "gone at power-off. The audience sees nothing of it tonight. Give /data a separate partition: bunraku "
    "doctor.",
    "This box keeps its data in memory, on {about}: sensors' keys, neutral poses, shows from sticks and the "
    "journal are gone at power-off. The audience sees nothing of it tonight. Give /data a separate "
    "partition: bunraku doctor.",
)
OF_THE_KEEPER = (
    *(JOURNAL_STOPPED, PLACE_NOT_SAVED, SENSORS_NOT_SAVED, GESTURES_NOT_SAVED),
    *(CHOICE_NOT_SAVED, SAVED_IN_MEMORY),
)
