"""From a reading to a share 0..1: range, curve, and how fast it may rise and fall."""

from __future__ import annotations

from itertools import pairwise

from appliance.pose.ease import ease
from appliance.show.light_rules import RuleConfig


def share(reading: float, ends: tuple[float, float]) -> float:
    """How far a reading is from the first to the second end, 0..1; the ends may fall."""
    return min(max((reading - ends[0]) / (ends[1] - ends[0]), 0.0), 1.0)


def bent(rule: RuleConfig, value: float) -> float:
    """The rule's curve: 0..1 -> 0..1."""
    if rule.curve == "s":
        return ease(value)
    if rule.curve == "gamma":
        return float(value**rule.gamma)
    if rule.curve == "points":
        return _between(rule.points, value)
    return value


def eased(before: float, wanted: float, attack_s: float, release_s: float, seconds: float) -> float:
    """The next value after `seconds`: a rise of 1 takes attack_s, a fall of 1 release_s; 0 s is at once."""
    over_s = attack_s if wanted > before else release_s
    if over_s <= 0.0:
        return wanted
    most = seconds / over_s
    return before + min(max(wanted - before, -most), most)


def _between(points: list[tuple[float, float]], value: float) -> float:
    """Straight lines between corners [in, out]; level before the first and behind the last."""
    if value <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in pairwise(points):
        if value <= x1:
            return y0 + (y1 - y0) * (value - x0) / (x1 - x0)
    return points[-1][1]
