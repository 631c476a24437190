"""Shares the stage's data with the box's other processes: facts once, every frame, health every second."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.outputs.puppet_facts import HandFacts, PuppetFacts
from appliance.outputs.shared_frame import Facts, FrameWriter
from appliance.show.box import BoxConfig
from appliance.show.hand import HandConfig
from appliance.show.look import LookConfig, looks_by_name
from appliance.show.show import Show
from appliance.show.springs import springs_by_name
from appliance.stage.health import Health
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.stage_parts import StageParts

_log = logging.getLogger(__name__)

_ZONE = Path("/sys/class/thermal/thermal_zone0/temp")


def facts_of(
    show: Show, box_file: Path | None, iterations: Iterations, now: float, rehearsal: bool = False
) -> Facts:
    """Facts about this stage for readers; `now`: it is about to dance."""
    config, names = show.config, show.config.names
    return Facts(
        show_directory=show.directory.resolve(),
        box_file=None if box_file is None else box_file.resolve(),
        show_name=config.name,
        skeleton=show.skeleton,
        puppets=tuple(
            PuppetFacts(
                puppet.name,
                tuple(HandFacts(hand.joint, hand.sensor or hand.kind, hand.by) for hand in puppet.hands),
                puppet.is_led,
            )
            for puppet in config.cast
        ),
        trackers=_trackers(hand for _, hand in config.hands_at),
        phrases=names["phrase"],
        cues=tuple(cue.model_dump(mode="json") for cue in config.cues),
        looks=names["look"],
        look_styles={name: _style(look) for name, look in looks_by_name(config.looks).items()},
        lights=names["lights"],
        springs=names["springs"],
        springs_feedback={name: one.feedback for name, one in springs_by_name(config.springs).items()},
        has_strings=config.strings is not None,
        cards=names["card"],
        has_partner=config.answerer is not None,
        goes_on=config.motion.goes_on is not None,
        coding=iterations.coding,
        interaction=iterations.interaction,
        most_iterations=iterations.most,
        pid=os.getpid(),
        started=now,
        rehearsal=rehearsal,
        motion={
            name: section.model_dump(mode="json", by_alias=True)
            for name, section in config.motion.made_sources.items()
        },
    )


def _style(look: LookConfig) -> dict[str, str]:
    """How a look is drawn: its style, and the colours that the show gives it."""
    return look.model_dump(
        mode="json", include={"style", "figure", "light", "accent", "background"}, exclude_none=True
    )


def _trackers(hands: Iterable[HandConfig]) -> dict[str, list[str]]:
    """Which joints each VMC tracker moves, of any puppet."""
    found: dict[str, list[str]] = {}
    for hand in hands:
        if hand.tracker is not None and hand.joint not in found.setdefault(hand.tracker, []):
            found[hand.tracker].append(hand.joint)
    return found


class Sharing:
    """The stage's place in the runtime folder: one stage a folder. Raises StageError where it has none.

    folder: where the box's processes meet. noted: where the stage notes what a keeper carries to the disk
    (place, journal, sensors' memory): the same folder, but in a rehearsal one within it, removed at its end.
    """

    def __init__(self, box: BoxConfig, rehearsal: bool = False) -> None:
        self.folder = self.noted = runtime_folder(box)
        self._claim = Claim(self.folder, "stage")
        self._rehearsed = self.folder / "rehearsal" if rehearsal else None
        if self._rehearsed is not None:
            self.noted = self._rehearsed
            self._forget_rehearsal()  # one that was killed
            self._rehearsed.mkdir(mode=0o700)
        self._thermometer = Thermometer()
        self.complaint = ""

    def begin(self, parts: StageParts, facts: Facts) -> None:
        """From now on frames are shared, if the folder has room for them; without it, the dance goes on."""
        try:
            parts.outputs.share(FrameWriter(self.folder, facts))
        except OSError as error:
            self.complaint = (
                f"{self.folder}: the frames cannot be shared ({error.strerror}). The dance goes on to all "
                "receivers in the network, but neither lights nor projector on this box see it. Free memory "
                "there, or give another folder as `runtime:` in the box file, and start again."
            )
            _log.warning(self.complaint)

    def publish_health(
        self,
        now: float,
        health: Health,
        reconciler: Reconciler,
        sensor_age_s: float | None,
        locked: bool,
        sensors: Sequence[Sequence[Any]],
        fallbacks: Sequence[Sequence[Any]] = (),
        paired: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Publish how the box is, after the frame has left; docs/outputs.md lists the keys.

        `sensors`: a line of the roster for each; `fallbacks`: those that ever happened; `sensor_age_s`: None
        without a sensor, infinite if unheard. `paired`: of a box that is one of several.
        """
        parts = reconciler.parts
        reported = health.snapshot(now)
        reported |= {
            "state": "dancing" if parts.rate else "stopped",
            "sensor_age_s": None if sensor_age_s in (None, float("inf")) else sensor_age_s,
            "locked": locked,
            "liveliness": parts.liveliness.level,
            "seed": parts.liveliness.seed,
            "wanted": reconciler.wanted,
            "motion": dict(reconciler.motion),
            "puppets": [
                {
                    "name": name,
                    "coding": one.iterations.coding,
                    "interaction": one.iterations.interaction,
                    "phrase": one.source,
                    "base": one.motion.base,
                    "made": one.motion.made.recipe if one.motion.made else "",
                    "position_s": one.motion.position_s,
                    "excerpt_s": one.motion.excerpt_s,
                    "is_led": one is parts.led,
                    "let_go": [held.joint for held in one.hands.puppeteers if not held.enabled],
                }
                for name, one in zip(parts.names, parts.puppets, strict=True)
            ],
            "cue": reconciler.cue,
            "applied": [reconciler.generation, reconciler.message],
            "looked_at": now,
            "sensors": sensors,
            "temperature_c": self._thermometer.celsius(),
            "receivers": [
                {
                    "name": one.name,
                    "sent": one.sent,
                    "dropped": one.dropped,
                    "error": one.last_error,
                    "gone": one.is_gone,
                    "asked_for": one.is_asked_for,
                }
                for one in parts.outputs.receivers
            ],
            "not_let_in": parts.not_let_in,
            "complaints": parts.complaints if parts.not_let_in else (),
            "fallbacks": fallbacks,
        }
        parts.outputs.publish_health({**reported, **paired})

    def close(self) -> None:
        self._forget_rehearsal()
        self._thermometer.close()
        self._claim.close()

    def _forget_rehearsal(self) -> None:
        if self._rehearsed is not None:
            shutil.rmtree(self._rehearsed, ignore_errors=True)


class Thermometer:
    """Reads what Linux calls the first thermal zone: on a Raspberry Pi that is the processor."""

    def __init__(self, zone: Path = _ZONE) -> None:
        try:
            self._descriptor = os.open(zone, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._descriptor = -1

    def celsius(self) -> float | None:
        """None on machines without one."""
        if self._descriptor < 0:
            return None
        try:
            return int(os.pread(self._descriptor, 32, 0)) / 1000.0
        except (OSError, ValueError):
            return None

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1
