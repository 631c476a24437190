"""The generator: one motion ahead of the stage, parameters that fade, kept motions, and what fails."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from appliance.box.made_motion import MadeMotion, MadeMotionReader
from appliance.box.orders import Order
from appliance.generator import request as requests
from appliance.generator.fallback import NOT_MADE, NOT_SAVED
from appliance.generator.generator import Pointing
from appliance.levers.show_state import ShowState
from appliance.outputs.joint_frame import PuppetFrame
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.show.show import load_show
from tests.bundles import FIGURE
from tests.command import Command
from tests.generator.conftest import Bench
from tests.sources import write_motion_network, write_show_with_sources
from tests.system.processes import wait_until

Benches = Callable[..., Bench]
NO_FADE: tuple[float, ...] = ()


def active(bench: Bench, name: str) -> bool:
    return any(one.name == name and one.active for one in bench.fallbacks.happened(time.monotonic()))


def newest(made: MadeMotionReader) -> MadeMotion:
    """What was made last."""
    found = made.read()
    assert found is not None
    return found


def test_one_variation_ahead_and_no_more(bench: Benches, tmp_path: Path) -> None:
    one = bench(write_show_with_sources(tmp_path / "show"))
    assert one.recipe() == {}, "nothing is made while a phrase is danced"
    one.declare(phrase=("vary", (0.5,)))
    first = one.recipe()
    assert (first["source"], first["phrase"], first["sigma"], first["seed"]) == ("vary", "main", 1.0, 1)
    assert newest(one.made).at_once
    assert one.recipe() == first, "what was made is not danced yet"
    second = one.dance()
    assert second["seed"] == 2 and not newest(one.made).at_once
    assert one.recipe() == second
    assert one.dance()["seed"] == 3
    one.reported["base"] = "other"
    one.declare(phrase=("path", (0.5,)))
    one.reported["base"] = "main"
    assert one.recipe()["source"] == "path"
    assert one.dance() == one.recipe(), "a path loops: the next one comes when another is asked for"
    assert len(list((one.folder / "material").iterdir())) <= 4


def test_an_improvisation_goes_on_from_what_is_danced(bench: Benches, tmp_path: Path) -> None:
    show = write_show_with_sources(tmp_path / "show")
    one = bench(show)
    one.reported["position_s"] = 0.5
    one.health["looked_at"] = time.monotonic()
    one.declare(phrase=("improvise", NO_FADE))
    first = one.recipe()
    assert first["source"] == "improvise" and first["after"] == 0
    assert 0.5 < first["from_s"] < 3.0 and newest(one.made).from_s == first["from_s"]
    second = one.dance()
    made = one.made.read()
    assert made is not None and not made.at_once
    assert second["after"] == first["number"] and second["seed"] == first["seed"] + 1
    assert 2.0 < second["from_s"] < 4.5 and second["prompt"] != first["prompt"]
    one.reported["position_s"] = 1.0
    one.declare(motion_improvise_temperature=("", (0.25,)))
    third = one.recipe()
    assert third["temperature"] == 0.25 and third["after"] == first["number"]
    assert newest(one.made).at_once and third["from_s"] > 1.0
    one.dance()
    health = one.health
    one.close()  # killed
    other = bench(show)
    other.health = health
    other.declare(phrase=("improvise", NO_FADE), motion_improvise_temperature=("", (0.25,)))
    fourth = other.recipe()
    assert fourth["after"] == third["number"] and fourth["seed"] == third["seed"] + 1
    assert not newest(other.made).at_once


def test_each_puppet_has_its_own_source(bench: Benches, tmp_path: Path) -> None:
    puppets = [{"name": "a"}, {"name": "b", "phrase": "vary"}, {"name": "c"}, {"name": "d", "phrase": "path"}]
    one = bench(write_show_with_sources(tmp_path / "show", puppets=puppets))
    reported = [{"name": one["name"], "base": "main", "made": "", "position_s": 0.0} for one in puppets[1:]]
    one.reported["name"] = "a"
    one.health |= {"puppets": [one.reported, *reported], "looked_at": time.monotonic()}
    made = [MadeMotionReader(one.folder, puppet) for puppet in range(4)]
    one.recipe()
    reported[0]["made"] = newest(made[1]).recipe
    one.recipe()  # a motion a look: the path that is waited for comes before the next variation
    assert made[3].read() is not None
    reported[0]["made"] = ""
    varied, path = (json.loads(newest(made[puppet]).recipe) for puppet in (1, 3))
    assert (varied["source"], path["source"]) == ("vary", "path")
    assert made[0].read() is None and made[2].read() is None
    one.declare(phrase=("vary", NO_FADE), motion_vary_sigma=("", (2.0,)))
    own = one.recipe()
    assert own["sigma"] == 2.0 and own["seed"] != varied["seed"], "no two dance the same variation"
    one.recipe()
    again = json.loads(newest(made[1]).recipe)
    assert (again["sigma"], again["seed"]) == (2.0, varied["seed"]), "values are those of all puppets"
    reported[0]["made"] = newest(made[1]).recipe
    one.recipe()
    assert json.loads(newest(made[1]).recipe)["seed"] == varied["seed"] + 1
    assert one.recipe() == own, "what it made for the others changes nothing of the first"
    for reader in made:
        reader.close()


def test_a_limb_that_a_hand_holds_points_at_the_map(tmp_path: Path) -> None:
    pointing, joint = Pointing(FIGURE, "lShldr"), FIGURE.index("lShldr")
    limb = FIGURE.offsets[FIGURE.parents.index(joint)]
    pose = np.tile(quaternion.IDENTITY, (len(FIGURE), 1))
    holds = np.zeros(len(FIGURE), np.float32)

    def pointed(*to: float) -> list[float]:
        axis, angle = np.cross(limb, to), np.arccos(limb @ np.array(to) / np.linalg.norm(limb))
        pose[joint] = quaternion.from_axis_angle(axis, angle)
        return pointing.point(cast(PuppetFrame, SimpleNamespace(pose=pose, holds=holds)))

    assert pointed(0.0, 0.1, 1.0) == []
    holds[joint] = 1.0
    ahead, up = pointed(0.0, 0.0, 1.0), pointed(0.0, 0.6, 0.8)
    assert ahead == [0.5, 0.5] and up[0] == 0.5 and up[1] == pytest.approx(0.8, abs=0.01)
    assert pointed(0.03, 0.6, 0.8) == up, "a tremble moves nothing"
    assert pointed(0.8, 0.0, 0.6)[0] == 0.9 and pointed(-0.8, 0.0, 0.6)[0] == 0.1
    assert pointed(0.01, -1.0, 0.0) == [0.5, 0.0] == pointed(-0.01, -1.0, 0.0), "a hanging arm does not leap"
    config = load_show(
        write_show_with_sources(tmp_path, {"path": {"by_hand": True}, "source": "path"})
    ).config
    requests_of = requests.Requests(config)
    request = requests_of.request(ShowState(show=config.name), "main", {}, 0.0, pointed=up)
    assert request is not None and request.recipe["points"] == up
    assert "points" not in requests_of.request(ShowState(show=config.name), "main", {}, 0.0).recipe  # type: ignore[union-attr]


def test_what_the_stage_could_not_take_over_is_made_again(bench: Benches, tmp_path: Path) -> None:
    one = bench(write_show_with_sources(tmp_path / "show"))
    one.declare(phrase=("path", NO_FADE))
    first = one.recipe()
    made = [one.recipe()["number"] for _ in range(8)]
    assert made[:3] == [first["number"]] * 3 and made[-1] != first["number"]
    assert len(set(made)) == 2, "once in five seconds"
    number = one.dance()["number"]
    assert {one.recipe()["number"] for _ in range(8)} == {number}


def test_a_generator_that_was_killed_goes_on_where_it_was(bench: Benches, tmp_path: Path) -> None:
    show = write_show_with_sources(tmp_path / "show")
    one = bench(show)
    one.declare(phrase=("vary", NO_FADE))
    one.recipe()
    danced = one.dance()
    health = {"puppets": [one.reported | {"made": newest(one.made).recipe}]}
    one.close()
    other = bench(show)
    other.health = health
    other.declare(phrase=("vary", NO_FADE))
    assert other.recipe()["seed"] == danced["seed"] + 1
    assert not newest(other.made).at_once


def test_parameters_reach_their_value_in_steps(
    bench: Benches, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "STEP_S", 1000.0)
    one = bench(write_show_with_sources(tmp_path / "show"))
    one.declare(phrase=("vary", NO_FADE))
    assert one.recipe()["sigma"] == 1.0
    one.declare(motion_vary_sigma=("", (3.0, 4000.0)))
    assert one.recipe()["sigma"] == 1.5
    one.declare(motion_vary_sigma=("", (0.5,)))
    assert one.recipe()["sigma"] == 0.5
    one.declare(motion_again=("", (2.0,)))
    assert one.recipe()["seed"] == 2001
    one.declare(phrase=("path", NO_FADE), motion_path_points=("", (0.25, 0.75)))
    recipe = one.recipe()
    assert recipe["points"] == [0.25, 0.75] and recipe["wobble"] == 0.3


def test_a_fade_ends_too_where_the_other_box_of_the_pair_counted_generations(
    bench: Benches, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are nanoseconds of a machine that was switched on long before this one."""
    monkeypatch.setattr(requests, "STEP_S", 1.0)
    one = bench(write_show_with_sources(tmp_path / "show"))
    one.declared = replace(one.declared, generation=int(1e9 * (time.monotonic() + 1e6)))
    one.declare(phrase=("vary", NO_FADE))
    assert one.recipe()["sigma"] == 1.0
    one.declare(motion_vary_sigma=("", (3.0, 4.0)))
    assert [one.recipe()["sigma"] for _ in range(6)][-1] == 3.0


def test_a_kept_motion_outlives_the_power_and_is_written_as_a_file(
    bench: Benches, tmp_path: Path, bunraku: Command
) -> None:
    show = write_show_with_sources(tmp_path / "show")
    one = bench(show)
    keep = Order("keep", text="anna")
    assert one.generator.obey(keep)[0] is False, "a phrase is kept already"
    one.declare(phrase=("vary", NO_FADE))
    saved = one.recipe()
    one.dance()
    for name, why in {"main": "already", "../up": "letters", "vary": "already"}.items():
        done, message = one.generator.obey(Order("keep", text=name))
        assert not done and why in message
    assert one.generator.obey(keep)[0]
    one.generator.saved.wait()
    for file in [*(one.folder / "kept").iterdir()]:  # the power is cut
        file.unlink()
    one.close()
    other = bench(show)
    wait_until(lambda: "anna" in other.generator.saved.recipes, "what was kept is not read")
    other.declare(phrase=("anna", NO_FADE))
    recipe = other.recipe()
    assert recipe["source"] == "kept" and recipe["of"] == saved
    assert other.dance()["number"] == recipe["number"], "it loops"
    settings = tmp_path / "box.yaml"
    settings.write_text("state: state\n")
    here = ["--show", show, "--box", settings]
    assert "anna: 3.0 s of vary (phrase main, seed 1, sigma 1.0)" in bunraku("kept", *here).out
    bunraku("kept", "anna", "--out", tmp_path / "anna.bvh", *here)
    written = read_bvh(tmp_path / "anna.bvh")
    danced = other.generator.saved.material("anna").loop
    turned = quaternion.angle_between(written.poses, danced.poses[:-1])
    assert len(written) == danced.length and np.degrees(turned).max() < 0.1
    assert np.abs(written.roots - danced.track[:-1, :3]).max() < 1e-4
    assert "Did you mean 'anna'" in bunraku("kept", "ana", *here, status=2).err


def test_a_disk_that_takes_nothing_is_told(bench: Benches, tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state/kept").write_text("a file where the folder should be")
    one = bench(write_show_with_sources(tmp_path / "show"))
    one.declare(phrase=("vary", NO_FADE))
    one.recipe()
    one.dance()
    assert one.generator.obey(Order("keep", text="anna"))[0], "it can be called until the box is switched off"
    one.generator.saved.wait()
    one.recipe()
    assert active(one, NOT_SAVED.name) and "anna" in one.generator.saved.recipes


def test_a_network_that_gives_nothing_sound_is_told(bench: Benches, tmp_path: Path) -> None:
    show = write_show_with_sources(tmp_path / "show")
    write_motion_network(show / "sequence.onnx", 32, fails=True)
    one = bench(show)
    one.declare(phrase=("vary", NO_FADE))
    assert one.recipe() == {} and active(one, NOT_MADE.name)
    one.declare(phrase=("path", NO_FADE))
    assert one.recipe()["source"] == "path" and not active(one, NOT_MADE.name)


def test_what_was_kept_is_not_lost_with_a_strange_file_beside_it(bench: Benches, tmp_path: Path) -> None:
    folder = tmp_path / "state/kept"
    folder.mkdir(parents=True)
    (folder / "strange.material").write_bytes(b"strange")
    one = bench(write_show_with_sources(tmp_path / "show"))
    wait_until(lambda: one.generator.saved.complaint, "nothing is said of it")
    assert one.generator.saved.recipes == {}
