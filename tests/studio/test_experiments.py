"""The first paper's experiments: excerpts by measure, the conditions, page and picture."""

from __future__ import annotations

import base64
import io
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from appliance.pictures.filmstrip import draw_strips
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.config_error import ConfigError
from appliance.studio.data.dataset import FPS, WINDOW, Take
from appliance.studio.data.regions import regions_of
from appliance.studio.experiments.claims import claims
from appliance.studio.experiments.claims_picture import COLOURS, draw_claims
from appliance.studio.experiments.excerpts import FRAMES, Excerpt, choose, measured, named
from appliance.studio.experiments.experiment import ExperimentOptions, _coders
from appliance.studio.experiments.families import CONDITIONS, Condition, Trial
from appliance.studio.experiments.null_networks import Paste
from appliance.studio.experiments.page import write_page
from appliance.studio.experiments.strips import strip_of_excerpts
from appliance.studio.studio_error import StudioError
from tests.studio.excerpt_takes import (
    ARMS,
    JOINTS,
    LEGS,
    Pausing,
    five_takes,
    take,
    trials,
    whole_skeleton,
)


@pytest.fixture(scope="module")
def skeleton() -> Skeleton:
    return whole_skeleton()


@pytest.fixture(scope="module")
def takes(skeleton: Skeleton) -> list[Take]:
    return five_takes(skeleton)


def test_each_kind_of_excerpt_is_found_where_it_is(takes: list[Take]) -> None:
    found = {one.name: one.take for one in choose(takes, JOINTS)}
    assert found == {
        "still": "nothing",
        "torso": "bending",
        "uncoordinated": "apart",
        "coordinated": "in_step",
        "partly": "everything",
    }


def test_an_excerpt_has_its_frames_and_what_the_windows_need_around_them(takes: list[Take]) -> None:
    for one in choose(takes, JOINTS):
        assert len(one.recording) == FRAMES + 2 * (WINDOW - 1)
        whole = next(take for take in takes if take.name == one.take).recording
        np.testing.assert_array_equal(one.recording.poses[WINDOW - 1], whole.poses[one.first])


def test_coordination_knows_step_from_chance(skeleton: Skeleton, takes: list[Take]) -> None:
    regions = regions_of(skeleton, JOINTS)
    places = [skeleton.index(name) for name in JOINTS]
    in_step, apart = (
        measured(take.recording.poses[:FRAMES, places], regions).coordination for take in (takes[3], takes[2])
    )
    assert in_step > 0.99 and apart < 0.5


def test_regions_are_told_by_shape(skeleton: Skeleton) -> None:
    found = regions_of(skeleton, JOINTS)
    assert {JOINTS[place] for place in found.arms} == set(ARMS)
    assert {JOINTS[place] for place in found.legs} == set(LEGS)
    assert {"abdomen", "chest"} <= {JOINTS[place] for place in found.torso}


def test_too_little_for_five_is_said(skeleton: Skeleton) -> None:
    with pytest.raises(StudioError, match="too short for five excerpts of 4 s: 2 fit"):
        choose([take(skeleton, "short", all=(JOINTS, 3, 1.0))], JOINTS)


def test_a_skeleton_without_limbs_is_said(skeleton: Skeleton) -> None:
    with pytest.raises(StudioError, match="--excerpts"):
        regions_of(skeleton, ("hip", "head"), "Name them with --excerpts.")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: {take: nothing}\n", "'a' does not say where it is"),
        ("a: {take: nothing, start: soon}\n", "'a' does not say where it is"),
        ("a: {take: elsewhere, start: 1}\n", "There is no take 'elsewhere'"),
        ("b: {take: nothing, start: 1}\na: {take: nothing, start: 9}\n", "excerpts.yaml:2: nothing ends"),
        ("a: {take: nothing, start: -1}\n", "'a' does not say where it is"),
        ("{}\n", "names no excerpt"),
    ],
)
def test_a_wrong_excerpts_file_is_told_with_its_line(
    takes: list[Take], tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "excerpts.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as refused:
        named(file, takes, JOINTS)
    assert message in str(refused.value)


def test_named_excerpts_are_taken(takes: list[Take], tmp_path: Path) -> None:
    file = tmp_path / "excerpts.yaml"
    file.write_text("mine: {take: apart, start: 2.5}\n")
    (found,) = named(file, takes, JOINTS)
    assert (found.name, found.take, found.first) == ("mine", "apart", 125)


@pytest.fixture(scope="module")
def copied(takes: list[Take]) -> list[Trial]:
    """What a dancer that only copies has danced."""
    found = trials(takes, Paste(JOINTS, np.tile(quaternion.IDENTITY, (len(JOINTS), 1))))
    for trial in found:
        trial.run()
    return found


def test_every_family_is_danced_as_long_as_its_hand_needs(copied: list[Trial]) -> None:
    trial = copied[0]
    assert set(trial.dances) == set(CONDITIONS)
    assert len(trial.dances[Condition("kept", (10, 10))].poses) == FRAMES
    slow = trial.dances[Condition("turning", (10, 10), "5s")]
    assert slow.hand is not None and len(slow.poses) == 750
    first = quaternion.angle_between(slow.hand[0], slow.hand[250])
    assert np.degrees(first) < 1.0, "five seconds are one turn"
    kept = trial.dances[Condition("kept", (1, 1))].poses
    np.testing.assert_allclose(np.abs((kept * trial.once.phrase).sum(-1)), 1.0, atol=1e-5)


def test_the_page_has_its_pictures_inside(copied: list[Trial], tmp_path: Path) -> None:
    trial = copied[0]
    strip = tmp_path / "strip.png"
    Image.new("RGB", (64, 32), "red").save(strip)
    page = tmp_path / "page.html"
    write_page(
        page,
        "A <title>",
        ["Words."],
        [trial.excerpt],
        {"a network": claims([trial])},
        {"paste": claims([trial])},
        {"Strips": [strip]},
    )
    text = page.read_text()
    assert "A &lt;title&gt;" in text and "does not hold" in text
    assert "degrees at most 3" in text and "paste passes, rightly" in text and "over 99 times" in text
    _, data = text.split("data:image/jpeg;base64,")
    shown = Image.open(io.BytesIO(base64.b64decode(data.split('"')[0])))
    assert shown.size == (64, 32)


def test_several_joints_are_kept_and_one_is_in_the_hand(takes: list[Take]) -> None:
    trial = trials(takes, Pausing(), ("lForeArm", "rThigh"))[0]
    trial.run()
    kept = trial.dances[Condition("kept", (10, 10))].poses
    off = quaternion.angle_between(kept, trial.once.phrase[: len(kept)]).max(axis=0)
    places = [JOINTS.index(name) for name in ("lForeArm", "rThigh")]
    assert off[places].max() < 1e-3 < off[JOINTS.index("rForeArm")]
    turned = trial.dances[Condition("turning", (10, 10), "1s")]
    assert turned.hand is not None
    assert quaternion.angle_between(turned.poses[:, places[0]], turned.hand).max() < 0.2, "the first one"
    assert quaternion.angle_between(turned.poses[:, places[1]], turned.hand[: len(turned.poses)]).max() > 1
    assert [trial.held_joints(Condition(family, (1, 1))) for family in ("coding", "kept", "turning")] == [
        (),
        ("lForeArm", "rThigh"),
        ("lForeArm",),
    ]


def test_the_report_is_one_picture_with_a_field_for_each_verdict(
    takes: list[Take], copied: list[Trial], tmp_path: Path
) -> None:
    found = claims(copied)
    excerpts = draw_strips(*strip_of_excerpts(tmp_path / "excerpts.png", choose(takes, JOINTS)[:1]))
    one, two = (
        np.asarray(
            Image.open(
                draw_claims(
                    tmp_path / f"{len(names)}.png",
                    "T",
                    dict.fromkeys(names, found),
                    excerpts,
                    {"paste": found},
                )
            )
        )
        for names in (["a"], ["a", "b"])
    )
    assert one.shape[1] == two.shape[1] and two.shape[0] > one.shape[0] + 300

    def area(picture: np.ndarray, holds: bool) -> int:
        colour = [int(COLOURS[holds][at : at + 2], 16) for at in (1, 3, 5)]
        return int((np.abs(picture[..., :3].astype(int) - colour).max(axis=-1) < 3).sum())

    held = [verdict for claim in found for verdict in claim.holds.values()]
    fields = [area(one, holds) / held.count(holds) for holds in (True, False)]
    assert fields[0] == pytest.approx(fields[1], rel=0.1) and fields[0] > 2000
    assert area(two, True) == pytest.approx(2 * area(one, True), rel=0.1)


def test_an_excerpt_reports_its_measures(takes: list[Take]) -> None:
    one: Excerpt = choose(takes, JOINTS)[0]
    assert one.as_json()["seconds"] == [round(one.first / FPS, 2), round((one.first + FRAMES) / FPS, 2)]


def test_networks_whose_files_have_one_name_are_all_compared(tmp_path: Path, tiny_show: Path) -> None:
    files = [tmp_path / folder / "puppet.onnx" for folder in ("one", "two", "three")]
    for file in files:
        file.parent.mkdir()
        shutil.copy(tiny_show / "puppet.onnx", file)
    found = list(_coders(ExperimentOptions(tiny_show, tmp_path / "out", networks=tuple(files))))
    assert found[:2] == ["mlp, fp32", "mlp, fp32, puppet.onnx"] and len(found) == 4
