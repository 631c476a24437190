"""The stage's frames for the page: the newest one as bytes, and what stays the same while it runs."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, cast

from appliance.box.ring_file import RingFileReader
from appliance.outputs.frame_layout import (
    BROWSER_HEAD,
    FACTS,
    FILE,
    FORMAT,
    FRAME_HEAD,
    FRAMES,
    GHOST,
    HEALTH,
    KIND,
    LATE,
    WRITER,
    FrameLayout,
)
from appliance.outputs.puppet_facts import layout_of, led_by, unpacked
from appliance.pose.foreign_file import plain_json
from appliance.pose.spoken_joints import spoken_joints
from appliance.show_control.status_messages import SeenFacts

STALE_S = 0.5
_LOOK_S = 0.1
_LEAST_HOLD = 0.01  # less is not seen
_OF_A_CUE = ("name", "look", "lights", "phrase", "master", "fade_s", "at")  # for the cue list


class StageView:
    """The shared frame of a runtime folder, read without numpy; never waits, never raises.

    facts: show, skeleton and hands, as the page gets them; empty before the first stage. seen_facts: as the
    stage wrote them. show_directory: for this box's own processes; None before the first stage. generation:
    another number for each new stage. with_ghost: the frame that `newest` gave last, with what the puppet
    starts from.
    """

    def __init__(self, folder: Path) -> None:
        self._file = RingFileReader(folder / FILE, KIND, FORMAT, WRITER)
        self._looked_at = -math.inf
        self._sequence = 0
        self._layout, self._led = FrameLayout(0), 0
        self.with_ghost = self._holds = b""
        self._frame_time = -math.inf
        self.facts: dict[str, Any] = {}
        self.seen_facts: SeenFacts | None = None
        self.show_directory: Path | None = None
        self.generation = 0

    def newest(self, now: float) -> bytes | None:
        """The newest frame for browsers; None where there is none that was not given before."""
        self._follow(now)
        if not self._file.rings:
            return None
        ring = self._file.rings[FRAMES]
        if ring.newest_sequence() == self._sequence or (found := ring.newest()) is None:
            return None
        self._sequence, payload = found
        if len(payload) != self._layout.bytes:
            return None
        tick, self._frame_time, _, _, _, flags, joints = FRAME_HEAD.unpack_from(payload)
        layout = self._layout
        ends = range(layout.root_at + layout.stride, layout.hands_at + 1, layout.stride)
        left_out = layout.world_at - layout.root_at
        seen = b"".join(payload[end - layout.stride + left_out : end] for end in ends)
        begin = layout.source_at + self._led * layout.stride
        source = payload[begin : begin + layout.world_at - layout.source_at]
        self._holds = payload[begin + layout.holds_at - layout.source_at :][: 4 * joints]
        self.with_ghost = BROWSER_HEAD.pack(tick, flags & LATE | GHOST, joints) + seen + source
        return BROWSER_HEAD.pack(tick, flags & LATE, joints) + seen

    def state(self, now: float) -> Literal["absent", "fresh", "stale"]:
        """stale: its newest frame is older than half a second, or it died."""
        self.newest(now)
        if not self._file.is_there or self._frame_time == -math.inf:
            return "absent"
        is_fresh = self._file.writer_lives() and now - self._frame_time <= STALE_S
        return "fresh" if is_fresh else "stale"

    def held(self) -> list[str]:
        """The joints that are held in the frame that `newest` gave last, of the puppet that cues lead."""
        holds = struct.unpack(f"<{len(self._holds) // 4}f", self._holds)
        joints = self.facts.get("joints", ())
        return [joint for joint, firmly in zip(joints, holds, strict=False) if firmly > _LEAST_HOLD]

    @property
    def lives(self) -> bool:
        """Whether the process that writes the frames is there."""
        return self._file.is_there and self._file.writer_lives()

    def health(self) -> dict[str, Any]:
        """The stage's last report; empty before the first."""
        found = self._file.rings[HEALTH].newest() if len(self._file.rings) > HEALTH else None
        try:
            said = plain_json(found[1]) if found else {}
        except ValueError:
            return {}
        return said if isinstance(said, dict) else {}

    def close(self) -> None:
        self._file.close()

    def _follow(self, now: float) -> None:
        if abs(now - self._looked_at) < _LOOK_S:
            return
        self._looked_at = now
        if not self._file.look():
            return
        self._sequence, self._frame_time, self._holds = 0, -math.inf, b""
        rings = self._file.rings
        found = rings[FACTS].newest() if len(rings) > FRAMES else None
        try:
            facts = plain_json(found[1] if found else b"")
            facts["puppets"] = unpacked(facts["puppets"])
            self._led = facts["puppets"].index(led_by(facts["puppets"]))
            self._layout = layout_of(
                len(facts["skeleton"]["joints"]), facts["puppets"], facts.get("phrases", ())
            )
            self.facts, self.show_directory = _for_browsers(facts), Path(facts["show_directory"])
            self.seen_facts = _seen(facts)
        except (ValueError, KeyError, TypeError, IndexError):
            self._file.refuse(f"holds no facts about a show. Start {WRITER} again.")
            return
        self.generation += 1


def _seen(facts: dict[str, Any]) -> SeenFacts:
    """By attribute; what an earlier release did not tell is empty."""
    empty: dict[str, Any] = {"cards": (), "springs": (), "motion": {}}
    return cast(SeenFacts, SimpleNamespace(**empty | facts))


def _for_browsers(facts: dict[str, Any]) -> dict[str, Any]:
    """No paths and no process numbers of the box."""
    skeleton, puppets = facts["skeleton"], facts["puppets"]
    hands = led_by(puppets).hands
    return {
        "show": facts["show_name"],
        "joints": skeleton["joints"],
        "parts": spoken_joints(skeleton["joints"]),
        "parents": skeleton["parents"],
        "offsets": skeleton["offsets"],
        "ends": skeleton["ends"],
        "held": [hand.joint for hand in hands],
        "hands": [hand.source for hand in hands],
        "by_position": [place for place, hand in enumerate(hands) if hand.by == "position"],
        "puppets": [puppet.name for puppet in puppets if puppet.name],
        "coding": facts["coding"],
        "interaction": facts["interaction"],
        "most_iterations": facts["most_iterations"],
        "rehearsal": facts["rehearsal"],
        "motion": facts.get("motion", {}),
        "cues": [{key: one[key] for key in _OF_A_CUE if one.get(key) is not None} for one in facts["cues"]],
        "look_styles": facts.get("look_styles", {}),
        "springs": facts.get("springs", []),
        "springs_feedback": facts.get("springs_feedback", {}),
        "has_strings": facts.get("has_strings", False),
        "goes_on": facts.get("goes_on", False),
    }
