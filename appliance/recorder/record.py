"""The layout of a journal: the fields of a tick and of an event, and the facts that explain them."""

from __future__ import annotations

import os
import platform
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from appliance.box.clock import TICK_S
from appliance.pose.skeleton import Skeleton, stance_facts, stance_of
from appliance.show.bundle import default_show_path

if TYPE_CHECKING:
    from appliance.show.hand import HandConfig
    from appliance.show.show import Show

LATE, NOT_FINITE, JUMPED, RESENT = 1, 2, 4, 8  # flags of a tick; RESENT: it sent the last pose once more
SECTIONS = ("drain", "motion", "puppeteers", "puppet", "blend", "figure", "send")
TICK, EVENT, PIECE = 1, 2, 3  # kinds of entries; PIECE: of an event that is too long for one entry
ORDER = "order"  # kind of the event that show control asked for something, and what came of it
# Exceptions that parsing a corrupt journal may raise.
DAMAGED = (ValueError, LookupError, ArithmeticError, TypeError, AttributeError, RecursionError, struct.error)
_LONGEST_TICK_S, _LAST_WRITTEN_AT = 1.0, 1e11  # seconds, and seconds since 1970: the year 5138
SAID = "said"  # kind of the event for a message to people


def record(joints: int, hands: int, sensors: int, live: int, puppets: int = 1) -> np.dtype[np.void]:
    """One tick: its slot, what it heard, what it made of it, and how long that took.

    hands: of all puppets, in the order of the facts. flags: NOT_FINITE and JUMPED of any puppet; failed: each
    puppet whose network gave no sound poses.

    live: 1 for a show with a live dancer, else 0. live_*: the pose that came of it in this tick; the arrival
    is not a number where none did.

    reading_*: the newest believed reading of each sensor in this tick, where reading_here says that there is
    one, as the link gave it: with them and the slot the tick can be run again.
    """
    return np.dtype(
        [
            ("tick", "<i8"),
            ("frame_time", "<f8"),
            ("started", "<f8"),
            ("sensor_sequence", "<i8"),
            ("sensor_arrival", "<f8"),
            ("flags", "<u4"),
            ("skipped", "<u4"),
            ("sections_ms", "<f4", (len(SECTIONS),)),
            ("targets", "<f4", (hands, 4)),
            ("weights", "<f4", (hands,)),
            ("failed", "u1", (puppets,)),
            ("iterations", "<u2", (puppets, 2)),  # coding, interaction
            ("root", "<f4", (puppets, 3)),
            ("pose", "<f4", (puppets, joints, 4)),
            ("live_arrival", "<f8", (live,)),
            ("live_root", "<f4", (live, 3)),
            ("live_pose", "<f4", (joints * live, 4)),
            ("reading_here", "u1", (sensors,)),
            ("reading_orientation", "<f8", (sensors, 4)),
            ("reading_times", "<f8", (sensors, 3)),  # measured_at, arrival, round_trip_s (not a number: none)
            # sequence, sensor_time_us, battery, calibration, boot_nonce, taps, recoveries, flags, wearable
            ("reading_numbers", "<i8", (sensors, 9)),
        ]
    )


def facts_of_run(show: Show, sensors: Sequence[str]) -> dict[str, Any]:
    """The metadata for the ticks of a run, as JSON: the figure, its hands, the show's files, the software.

    `sensors`: whose readings are noted, in this order. A show that comes with the box has no directory: it
    lies somewhere else on each of them.
    """
    import onnxruntime  # loaded in the stage already; no other process needs it for a journal

    skeleton, bundled = show.skeleton, show.directory.resolve() == default_show_path().resolve()
    hands = [
        {"puppet": number, "joint": hand.joint, "kind": hand.kind, "sensor": hand.sensor, "by": hand.by}
        for number, hand in hands_of(show)
    ]
    puppets, live = puppets_of(show), int(show.config.motion.live)
    layout = record(len(skeleton), len(hands), len(sensors), live, len(puppets))
    files = [show.file.path, show.network, *dict.fromkeys(show.phrases.values())]
    return {
        "run": os.urandom(8).hex(),
        "record": [(name, layout[name].base.str, layout[name].shape) for name in layout.names or ()],
        "tick_s": TICK_S,
        "sections": SECTIONS,
        "hands": hands,
        "sensors": list(sensors),
        "puppets": puppets,
        "joints": skeleton.names,
        "parents": [int(parent) for parent in skeleton.parents],
        "offsets": np.asarray(skeleton.offsets).tolist(),
        "ends": [(int(joint), [float(part) for part in offset]) for joint, offset in skeleton.ends],
        **stance_facts(skeleton),
        "show": show.config.name,
        "show_directory": None if bundled else str(show.directory.resolve()),
        "show_files": [os.path.relpath(path, show.directory) for path in files],
        "pid": os.getpid(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "onnxruntime": onnxruntime.__version__,
    }


def puppets_of(show: Show) -> list[str]:
    """The name of each puppet; "" in a show that has one without a name."""
    return [puppet.name for puppet in show.config.cast]


def hands_of(show: Show) -> list[tuple[int, HandConfig]]:
    """The hands of all puppets, each with its puppet's number."""
    return [(puppet.number, hand) for puppet in show.config.cast for hand in puppet.hands]


def require_sound(facts: dict[str, Any]) -> None:
    """Raises KeyError, ValueError or TypeError where a file's facts are not those of a run."""
    figure, layout = skeleton_of(facts), layout_of(facts)
    live = min(layout["live_arrival"].shape[0], 1)
    puppets = facts["puppets"]
    needed = record(len(figure), len(facts["hands"]), len(facts["sensors"]), live, len(puppets))
    for name in needed.names or ():
        if layout[name] != needed[name]:
            raise ValueError(f"another '{name}' in its ticks")
    for hand in facts["hands"]:
        figure.index(hand["joint"]), puppets[hand["puppet"]]
    directory, files = facts["show_directory"], facts["show_files"]
    texts = [facts["run"], facts["show"], *facts["sensors"], *files, *files.values()]
    texts += [] if directory is None else [directory]
    texts += puppets
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("names that are no text")
    if not 0.0 < facts["tick_s"] < _LONGEST_TICK_S or not 0.0 <= facts["written_at"] < _LAST_WRITTEN_AT:
        raise ValueError("times that no clock shows")


def layout_of(facts: dict[str, Any]) -> np.dtype[np.void]:
    """The layout that a run's facts describe. Raises KeyError, ValueError or TypeError where they do not."""
    return np.dtype([(name, form, tuple(shape)) for name, form, shape in facts["record"]])


def holds_of(header: dict[str, Any], ticks: np.ndarray[Any, np.dtype[np.void]]) -> np.ndarray:
    """(N, P, J): how firmly a hand held each joint of each puppet in ticks (N,) of a run, 0 to 1."""
    skeleton, hands = skeleton_of(header), header["hands"]
    holds = np.zeros((len(ticks), len(header["puppets"]), len(skeleton)), np.float32)
    joints = [skeleton.index(hand["joint"]) for hand in hands]
    holds[:, [hand["puppet"] for hand in hands], joints] = ticks["weights"]
    return holds


def skeleton_of(facts: dict[str, Any]) -> Skeleton:
    """The figure that danced."""
    return Skeleton(
        tuple(facts["joints"]),
        tuple(facts["parents"]),
        np.asarray(facts["offsets"], np.float64),
        tuple((int(joint), (float(x), float(y), float(z))) for joint, (x, y, z) in facts["ends"]),
        stance_of(facts),
    )
