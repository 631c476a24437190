"""Is the held dance alive? Its figures beside those of four baselines, over all pairs of phrase and hand.

phrase: as recorded, with its own joint. pasted: the phrase with the hand's orientation on the held joint.
network: the coder. matching: motion matching with the held joint put in. Each useless dancer fails a figure:
one that copies is off the hand, one that pastes has no coupling, one that goes to the mean has no spread.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.coupling import coupling, coupling_fidelity
from appliance.studio.evaluation.critic import critic
from appliance.studio.evaluation.dance_figures import degrees_apart
from appliance.studio.evaluation.field_metrics import foot_skate_ratio, jerk, physical_foot_contact
from appliance.studio.evaluation.limbs import limb_figures, limbs_of
from appliance.studio.evaluation.measurement import STEP, Danced, Measurement
from appliance.studio.evaluation.motion_features import clip_begins
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.evaluation.recorded import Recorded, positions_of

FIGURES = (
    "critic", "critic_legs", "critic_moving",
    "spread_legs", "spread_trunk", "spread_arms", "spread_held_limb",
    "energy_legs", "energy_trunk", "energy_arms", "energy_held_limb",
    "off_phrase", "held", "fit", "plausibility", "coupling", "coupling_fidelity", "masked", "masked_nearest",
    "fid_kinetic", "fid_geometric", "jerk", "jerk_ratio", "foot_skate_ratio", "foot_skate_against_phrase",
    "pfc", "pfc_ratio", "coverage", "recall", "nearest_moment", "memorisation",
)  # fmt: skip
RATIOS = {"jerk": "jerk_ratio", "pfc": "pfc_ratio", "foot_skate_ratio": "foot_skate_against_phrase"}
EVERY = 2 * STEP  # ticks between searches: many dances are measured
Row = dict[str, float | None]


class Comparison:
    """The figures of dances on the same phrases; what belongs to the phrases is measured once."""

    def __init__(self, measurements: Sequence[Measurement], recorded: Recorded) -> None:
        self.measurements, self._recorded = measurements, recorded
        self.joints = measurements[0].joints
        self._takes = [one.pair.phrase_name for one in measurements]
        self._phrases = [one.phrase for one in measurements]

    def of_joint(self, joint: str, network: Sequence[Danced]) -> dict[str, Row]:
        """Baseline to FIGURES, the coder's dances given; None for what could not be measured."""
        held, places = self.joints.index(joint), zip(self.measurements, network, strict=True)
        kinds: dict[str, list[Danced]] = {
            "phrase": [],
            "pasted": [],
            "network": list(network),
            "matching": [],
        }
        for one, dance in places:
            phrase = one.rehearsal.phrase[: len(dance.shown)]
            kinds["phrase"].append(one.as_recorded(joint, len(phrase)))
            pasted = phrase.copy()
            pasted[:, held] = dance.hand
            kinds["pasted"].append(one.stood(joint, pasted, dance.hand))
            if self._recorded.matching is not None:
                _, hand = one.level(dance)
                matched = self._recorded.matching.dance(without_heading(phrase), held, hand)
                kinds["matching"].append(one.stood(joint, _with_heading(matched, phrase), dance.hand))
        return {kind: self.row(joint, dances, kind) for kind, dances in kinds.items() if dances}

    def of_free(self, coding_iterations: int) -> Row:
        """Critics, spread and energy of the dance without a hand."""
        dances = [without_heading(one.rehearsal.free(coding_iterations)) for one in self.measurements]
        return _rounded({**self._critics(dances, None), **self._limbs(dances, None)})

    @cached_property
    def reference(self) -> Row:
        """FID of recordings against recordings, and of another dancer: as many clips as the dances have."""
        clips = sum(len(clip_begins(len(phrase), FPS)) for phrase in self._phrases)
        figures = (*self._recorded.floor(clips), *self._recorded.ceiling(clips))
        names = [f"fid_{kind}_{end}" for end in ("floor", "ceiling") for kind in ("kinetic", "geometric")]
        return _rounded(dict(zip(names, figures, strict=True)))

    def row(self, joint: str, dances: Sequence[Danced], kind: str = "network") -> Row:
        """FIGURES of one dance for each pair."""
        level, hands = [], []
        for one, dance in zip(self.measurements, dances, strict=True):
            poses, hand = one.level(dance)
            level.append(poses)
            hands.append(hand)
        is_phrase = kind in ("phrase", "pasted")  # for the critics, that do not see the held joint
        found = {
            **(self._critics_of_phrase if is_phrase else self._critics(level, joint)),
            **self._limbs(level, joint),
            **self._with_hands(joint, level, hands),
            **(self._space_of_phrase if kind == "phrase" else self._space(dances)),
            **self._coverage(joint, level),
        }
        for name, ratio in RATIOS.items():
            own = self._space_of_phrase[name]
            found[ratio] = found[name] / own if own > 0 else float("nan")
        rounded = _rounded(found)
        return {name: rounded.get(name) for name in FIGURES}

    @cached_property
    def _critics_of_phrase(self) -> dict[str, float]:
        return self._critics(self._phrases, None)

    def _critics(self, dances: Sequence[Array], joint: str | None) -> dict[str, float]:
        phrases = [phrase[: len(dance)] for phrase, dance in zip(self._phrases, dances, strict=True)]
        others = [place for place, name in enumerate(self.joints) if name != joint]
        legs = limbs_of(self.joints, joint).get("legs", [])
        seen = {"critic": (others, False), "critic_legs": (legs, False), "critic_moving": (others, True)}
        return {
            name: critic(phrases, dances, places, self._takes, moving) if places else float("nan")
            for name, (places, moving) in seen.items()
        }

    def _limbs(self, dances: Sequence[Array], joint: str | None) -> dict[str, float]:
        limbs = limbs_of(self.joints, joint)
        rows = [
            limb_figures(dance, phrase[: len(dance)], limbs)
            for dance, phrase in zip(dances, self._phrases, strict=True)
        ]
        return {name: _mean([row[name] for row in rows]) for name in rows[0]}

    def _with_hands(self, joint: str, dances: Sequence[Array], hands: Sequence[Array]) -> dict[str, float]:
        """How dances go with the hand, and how far from the phrase; masked: from what the hand's take did."""
        held = self.joints.index(joint)
        others = [place for place in range(len(self.joints)) if place != held]
        reference = self.measurements[0].reference
        seen = [dance[:, others] for dance in dances]
        coupled = coupling(seen, hands)
        own = self._recorded.own_coupling(joint)
        if own is None:
            own = coupling(
                [part[:, others] for part in self._phrases], [part[:, held] for part in self._phrases]
            )
        off, away, fit, masked, nearest = [], [], [], [], []
        for one, dance, hand, part in zip(self.measurements, dances, hands, seen, strict=True):
            off.append(degrees_apart(dance[:, [held]], hand[:, None]).mean())
            away.append(degrees_apart(part, one.phrase[: len(part), others]).mean())
            fit.append(_mean(reference.nearest(dance[::EVERY], others, held, hand[::EVERY])))
            really = one.hand_take(len(dance))
            masked.append(degrees_apart(part[: len(really)], really[:, others]).mean())
            guess = reference.holding_nearest(held, really[:, held])
            nearest.append(degrees_apart(guess[:, others], really[:, others]).mean())
        return {
            "held": _mean(off),
            "off_phrase": _mean(away),
            "fit": _mean(fit),
            "masked": _mean(masked),
            "masked_nearest": _mean(nearest),
            "coupling": float(np.mean(coupled)),
            "coupling_fidelity": coupling_fidelity(coupled, own),
        }

    @cached_property
    def _space_of_phrase(self) -> dict[str, float]:
        return self._space([one.as_recorded(self.joints[0], len(one.phrase)) for one in self.measurements])

    def _space(self, dances: Sequence[Danced]) -> dict[str, float]:
        """Figures of bodies in the room, as they leave the box."""
        skeleton = self.measurements[0].rehearsal.recording.skeleton
        positions = [positions_of(skeleton, dance.standing, dance.roots) for dance in dances]
        kinetic, geometric = self._recorded.fid(skeleton, positions)
        skates, contacts = [], []
        for one, dance in zip(self.measurements, dances, strict=True):
            soles, heights = one.body.soles(dance.standing, dance.roots)
            skates.append(foot_skate_ratio(soles, heights, FPS))
            contacts.append(physical_foot_contact(dance.roots, soles, FPS))
        return {
            "fid_kinetic": kinetic,
            "fid_geometric": geometric,
            "jerk": _mean([jerk(points, FPS) for points in positions]),
            "foot_skate_ratio": _mean(skates),
            "pfc": _mean(contacts),
        }

    def _coverage(self, joint: str, dances: Sequence[Array]) -> dict[str, float]:
        recorded, together = self._recorded.motion, np.concatenate([dance[::EVERY] for dance in dances])
        reference = self.measurements[0].reference
        far = [reference.nearest(dance[::EVERY]).mean() for dance in dances]
        own = [
            one.phrase_far[::2][: len(dance[::EVERY])].mean()
            for one, dance in zip(self.measurements, dances, strict=True)
        ]
        degrees, memorisation = recorded.nearest_moments(dances, EVERY, self.joints.index(joint))
        return {
            "plausibility": _mean([a / b if b > 0 else float("nan") for a, b in zip(far, own, strict=True)]),
            "coverage": recorded.coverage(together),
            "recall": recorded.recall(together),
            "nearest_moment": degrees,
            "memorisation": memorisation,
        }


def _with_heading(level: Array, phrase: Array) -> Array:
    """Poses (T, M, 4), headings removed, turned to the phrase's heading."""
    turned = level.copy()
    turned[:, :1] = quaternion.multiply(quaternion.heading(phrase[:, :1]), level[:, :1])
    return turned


def _mean(values: Sequence[float] | Array) -> float:
    """Mean of the finite values; NaN without any."""
    known = [float(value) for value in values if math.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _rounded(figures: Mapping[str, float]) -> Row:
    return {name: round(value, 3) if math.isfinite(value) else None for name, value in figures.items()}
