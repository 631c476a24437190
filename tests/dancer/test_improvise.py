"""Improvising with the network of the default show: in step, without a seam, the same again."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest

from appliance.dancer.grounding import survey
from appliance.dancer.loop import Loop, yaws
from appliance.dancer.material.maker import Maker
from appliance.dancer.material.material_file import recipe_text
from appliance.dancer.material.prompt import end_of, prompt_of, unpacked_steps
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import FPS, NUMBER, SHARED, X, Z
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from appliance.show.show import Show, load_show

FROM = 12 * 50  # the frame of the phrase
AROUND = 70  # ticks from a join on: the crossfade, and a little


class Improvisations:
    """Parts that go on from each other, as the generator makes them and the stage dances them."""

    def __init__(self, show: Show) -> None:
        recording = read_bvh(show.phrases["main"]).excerpt(0.0, 20.0)
        self.motion = Playback(recording, floor=survey(recording))
        self.phrase = self.motion.loop_of("main")
        self._joints = show.skeleton
        self.maker = Maker(show.skeleton, show.motion_networks, self.motion.loop_of, grounded=True)
        self.network = self.maker.network("improvise")

    def recipe(self, number: int, after: Loop, frame: int, **other: Any) -> dict[str, Any]:
        network = self.network
        prompt = prompt_of(after, frame, self._joints, network, network.places)  # type: ignore[arg-type]
        goes_on = {"after": round(float(after.track[0, NUMBER])), "from_s": after.start_s + frame / FPS}
        asked = {"source": "improvise", "temperature": 1.0, "seconds": 8.0, "seed": number, "number": number}
        return asked | goes_on | {"prompt": prompt} | other


@pytest.fixture(scope="module")
def made() -> Improvisations:
    return Improvisations(load_show(default_show_path()))


def degrees(one: np.ndarray[Any, Any], other: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.degrees(quaternion.angle_between(one, other))


def test_parts_that_follow_each_other_show_no_seam(made: Improvisations) -> None:
    motion, joints = made.motion, made.network.places
    usual = degrees(made.phrase.poses[1:, joints], made.phrase.poses[:-1, joints]).max(axis=1)
    first = made.recipe(1001, made.phrase, FROM)
    loop = made.maker.make(first)
    second = made.recipe(1002, loop, end_of(loop))
    poses, joins = [], []
    for recipe in (first, second):
        while motion.number != recipe["after"] or motion.position_s < recipe["from_s"]:
            poses.append(motion.window()[0].copy())
            motion.advance()
        joins.append(len(poses))
        motion.enter(recipe_text(recipe), made.maker.make(recipe), 1.0)
    for _ in range(AROUND):
        poses.append(motion.window()[0].copy())
        motion.advance()
    danced = np.array(poses)[:, joints]
    steps = degrees(danced[1:], danced[:-1]).max(axis=1)
    for join in joins:
        assert steps[join : join + AROUND].max() < usual.max()
    assert motion.position_s == pytest.approx(AROUND / FPS, abs=0.2), "in step from its first frames on"


def test_parts_that_follow_each_other_for_a_long_time_stay_on_the_stage(made: Improvisations) -> None:
    loop, roots, turned, at = made.phrase, [], 0.0, np.zeros(2)
    frame = FROM
    for number in range(1001, 1013):
        loop = made.maker.make(made.recipe(number, loop, frame))
        frame = end_of(loop)
        way = np.diff(loop.track[: frame + 1, [X, Z]], axis=0)
        cosine, sine = np.cos(turned), np.sin(turned)
        path = at + np.cumsum(way @ [[cosine, -sine], [sine, cosine]], axis=0)
        roots.append(path)
        heading = quaternion.heading(loop.poses[[0, frame], 0].astype(float))
        at, turned = path[-1], turned + float(np.diff(yaws(heading))[0])
    assert np.ptp(np.concatenate(roots), axis=0).max() < 3.6


def test_its_first_second_dances_the_end_of_the_prompt_again(made: Improvisations) -> None:
    loop = made.maker.make(made.recipe(1001, made.phrase, FROM))
    theirs, ours = made.phrase.poses[FROM : FROM + SHARED].copy(), loop.poses[:SHARED].copy()
    for part in (theirs, ours):
        turned = quaternion.inverse(quaternion.heading(part[:, 0]))
        part[:, 0] = quaternion.multiply(turned, part[:, 0])
    joints = made.network.places
    again = degrees(theirs, ours)[:, joints].mean()
    elsewhere = degrees(theirs, loop.poses[-SHARED:])[:, joints].mean()
    assert again < 0.3 * elsewhere


def test_the_same_recipe_is_the_same_dance_and_temperature_0_draws_nothing(made: Improvisations) -> None:
    recipe = made.recipe(1001, made.phrase, FROM)
    loops = [made.maker.make(recipe | other) for other in ({}, {}, {"seed": 5}, {"temperature": 0.3})]
    dances = [loop.poses.tobytes() + loop.track.tobytes() for loop in loops]
    assert dances[0] == dances[1] and len(set(dances)) == 3
    cold = [made.maker.make(recipe | {"temperature": 0.0, "seed": seed}).poses.tobytes() for seed in (1, 2)]
    assert cold[0] == cold[1]
    moved = degrees(loops[0].poses[1:], loops[0].poses[:-1]).max(axis=1)
    assert moved[-25:].max() <= 1.5 * moved[:-25].max(), "it comes round without a jump"


def test_a_prompt_of_another_network_is_refused(made: Improvisations) -> None:
    recipe = made.recipe(1001, made.phrase, FROM)
    for wrong in ("", "not a prompt!", recipe["prompt"][4:]):
        with pytest.raises(ValueError, match="prompt"):
            made.maker.make(recipe | {"prompt": wrong})
    nothing = unpacked_steps(recipe["prompt"], made.network.latent + 4).astype("<f2")
    nothing[0, 0] = np.nan
    with pytest.raises(ValueError, match="numbers that are not finite"):
        made.maker.make(recipe | {"prompt": base64.b64encode(nothing.tobytes()).decode()})
