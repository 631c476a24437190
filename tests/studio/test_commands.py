"""bunraku train, evaluate, export: what an artist does, from recordings to a show that the box accepts."""

from __future__ import annotations

import contextlib
import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import Result

from appliance.pose import quaternion
from appliance.pose.body_facts import fronts, sampled_positions
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.reading_options import ReadingOptions
from appliance.show.bundle import (
    bundle_files,
    checksum_problems,
    default_show_path,
    unlisted_files,
    write_checksums,
)
from appliance.show.check import not_as_packed, verify_bundle
from appliance.show.show import load_show
from appliance.studio.data.catalogue import Catalogue, recordings_in
from appliance.studio.data.dataset import load_dataset
from appliance.studio.data.remembered import Remembered, reading_facts
from appliance.studio.data.sources import remembered
from appliance.studio.evaluation.coders import load_state
from appliance.studio.evaluation.findings import few_data, findings
from appliance.studio.export import gate, release
from appliance.studio.export.packing import write_show_yaml
from tests.studio.conftest import Said, bunraku
from tests.studio.tiny import swaying, write_recordings

Trained = tuple[Path, Said]
HANDS = ["evaluate", "{show}", "{rec}/sway_0.bvh", "--reference", "{rec}", "--hands"]


def said(result: Result | Said) -> str:
    """What was said, its line breaks undone."""
    return " ".join(result.stderr.split())


def test_training_ends_with_a_show_that_the_box_accepts(trained: Trained) -> None:
    show, result = trained
    assert result.exit_code == 0, result.output
    assert verify_bundle(show) == []
    config = load_show(show).config
    assert config.name == "evening" and config.hands[0].joint == "lShldr"
    skeleton = load_show(show).skeleton
    arm = skeleton.offsets[skeleton.index("lForeArm")]
    w, _, _, z = config.hands[0].at_neutral
    assert arm[0] > 0 and w == pytest.approx(0.766, abs=0.001) and z == pytest.approx(-0.643, abs=0.02)


def test_training_tells_what_it_found_and_how_it_went(trained: Trained) -> None:
    output = said(trained[1])
    for expected in (
        "3 recordings of 3 takes",
        "17 of 20 joints move",
        "The others never turn and stay as they are",
        "Kept apart to measure on, by take: sway_2",
        "20 steps on the CPU (1 thread)",
        "degrees on held-out takes",
        "computes what was trained",
        "The bundle contains a recording",
    ):
        assert expected in output, expected


def test_training_ends_with_whether_the_dancer_answers(trained: Trained) -> None:
    show, result = trained
    answer = json.loads((show / "report.json").read_text())["puppetry"]
    assert answer["lShldr"]["10_9"]["answer"] >= 0 and answer["free"]["30"]["plausibility"] > 0
    assert "with hands of sway_0" in answer["measured_on"]
    output = said(result)
    assert "Does the hand move the body?" in output and "with a hand on lShldr at 10/9" in output
    assert answer["verdict"] in output and output.index(answer["verdict"]) < output.index(
        "is a show. Dance it"
    )
    assert "answer.png" in (show / "SHA256SUMS").read_text()


def test_training_leaves_its_history_and_pictures(trained: Trained) -> None:
    show, _ = trained
    reported = json.loads((show / "training.json").read_text())
    assert reported["settings"]["width"] == 48 and reported["history"][-1]["step"] == 20
    assert reported["history"][-1]["held_out_degrees"] > 0
    for picture in (show / "pictures" / "losses.png", show / "report.png", show / "answer.png"):
        assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 10_000
    listed = (show / "SHA256SUMS").read_text()
    assert "puppet.onnx" in listed and "checkpoint.pt" not in listed and "pictures" not in listed


def test_the_report_holds_what_the_stage_and_the_artist_need(trained: Trained) -> None:
    report = json.loads((trained[0] / "report.json").read_text())
    assert report["network"]["ships"] in ("fp32", "int8")
    assert report["evaluated_on"] == ["sway_2"]
    assert report["training"]["steps"] == 20
    assert report["equality_with_pytorch"]["largest_difference"] <= 1e-4
    assert len(report["joint_range_degrees"]) == 17
    assert all(0 < degrees <= 180 for degrees in report["joint_range_degrees"].values())
    assert 0 < report["random_latents"]["share_within_range"] <= 1
    assert set(report["median_ms_of_ten_iterations"]) == {"fp32", "int8"}
    assert report["quantization"]["degrees"]["10"]["mean"] > 0
    for row in report["bounds"].values():
        assert row["holds"] == (row["from"] <= row["value"] <= row["to"])
    assert report["bounds"]["degrees after one iteration"]["value"] == report["degrees"]["1"]["mean"]


def test_evaluate_gives_the_agreed_json(trained: Trained, recordings: Path) -> None:
    for network in (trained[0], trained[0] / "puppet.onnx", trained[0] / "checkpoint.pt"):
        result = bunraku("evaluate", network, recordings / "sway_2.bvh", "--true-fps", 50, "--json")
        figures = json.loads(result.stdout)
        assert set(figures["degrees"]) == {"1", "2", "5", "10"}
        assert all(set(row) == {"mean", "p95", "max"} for row in figures["degrees"].values())
        assert set(figures["centimetres"]) == {"1", "10"}
        assert all(set(row) == {"mean", "max"} for row in figures["centimetres"].values())
        assert {"mean", "std"} <= set(figures["latent"])
        assert figures["masked_frames"] == 0
    report = json.loads((trained[0] / "report.json").read_text())
    assert figures["degrees"] == report["degrees"]  # the checkpoint, on the take that was held out


def test_evaluate_for_people_is_a_table(trained: Trained, recordings: Path) -> None:
    result = bunraku("evaluate", trained[0], recordings / "sway_0.bvh", recordings / "sway_1.bvh")
    assert result.exit_code == 0
    assert "iterations" in result.stdout and "Latents: mean" in result.stdout
    assert "sway_0: 4.0 s, 50 poses a second." in said(result)


def test_evaluate_measures_the_answer_to_a_hand(tiny_show: Path, recordings: Path, tmp_path: Path) -> None:
    phrase, hand, picture = recordings / "sway_2.bvh", recordings / "sway_0.bvh", tmp_path / "answer.png"
    asked = ["evaluate", tiny_show, phrase, "--hands", hand, "--reference", recordings]
    asked += ["--joint", "lShldr", "--iterations", "2/1", "--iterations", "3/3"]
    result = bunraku(*asked, "--json", "--picture", picture)
    assert result.exit_code == 0, said(result)
    figures = json.loads(result.stdout)
    assert {"degrees", "centimetres", "latent"} <= set(figures)
    answer = figures["puppetry"]
    row = answer["lShldr"]["3_3"]
    expected = {"answer", "fit", "fit_own", "fit_bare", "plausibility", "energy", "roughness", "held"}
    assert expected | {"arm_in_trunk", "foot_skate"} <= set(row)
    assert row["answer"] > 0 and row["held"] < 5.0
    assert set(answer["free"]) == {"1", "10", "30", "100"}
    assert answer["reference"]["poses"] == 200  # sway_1: the phrase's and the hand's takes are no reference
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "with the hands of sway_0" in said(result)


@pytest.mark.usefixtures("unmeasured")
def test_export_keeps_what_the_artist_wrote(trained: Trained, tmp_path: Path) -> None:
    out = tmp_path / "other"
    out.mkdir()
    text = "name: Mine\nhands:\n  - {turning: {axis: [0, 1, 0]}, joint: head}\n"
    (out / "show.yaml").write_text(text)
    write_bvh(tmp_path / "phrase.bvh", swaying(2.0, seed=7))
    phrase = tmp_path / "phrase.bvh"
    result = bunraku("export", trained[0] / "checkpoint.pt", "--out", out, "--phrase", phrase)
    assert result.exit_code == 0, said(result)
    assert (out / "show.yaml").read_text() == text
    assert read_bvh(out / "phrase.bvh").seconds == pytest.approx(2.0)
    assert "contains a recording" not in said(result)
    assert verify_bundle(out) == []


@pytest.mark.usefixtures("unmeasured")
def test_takes_that_came_or_went_since_never_make_a_learned_one_the_measure(
    trained: Trained, recordings: Path, tmp_path: Path
) -> None:
    """sway_2 was kept apart. Without it sway_1 would be the last one, and with another one sway_2 is not."""
    checkpoint = trained[0] / "checkpoint.pt"
    for name in ("fewer", "more"):
        shutil.copytree(recordings, tmp_path / name)
    (tmp_path / "fewer" / "sway_2.bvh").unlink()
    write_bvh(tmp_path / "more" / "z_new.bvh", swaying(4.0, seed=9))
    for name, held_out in (("fewer", []), ("more", ["sway_2", "z_new"])):
        asked = ["export", checkpoint, "--out", tmp_path / f"{name}_show", "--recordings", tmp_path / name]
        result = bunraku(*asked)
        assert result.exit_code == 0, said(result)
        report = json.loads((tmp_path / f"{name}_show" / "report.json").read_text())
        assert report["training"]["takes"] == ["sway_0", "sway_1"]
        assert report["training"]["held_out"] == held_out
    state = load_state(checkpoint)
    resumed = remembered(state, tmp_path / "fewer", checkpoint).load(lambda files: files)
    assert "learned from all of these takes" in " ".join(findings(resumed))


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("step", ["evaluate", "own_answer", "draw_report"])
def test_an_export_that_is_interrupted_leaves_the_show_that_was_there(
    step: str, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    show = shutil.copytree(trained[0], tmp_path / "show")
    (show / "puppet.onnx").write_bytes(b"another network")
    write_checksums(show)
    before = {name: (show / name).read_bytes() for name in bundle_files(show)}

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(release, step, interrupted)
    result = bunraku("export", show / "checkpoint.pt", "--out", show)
    assert result.exit_code, said(result)
    assert {name: (show / name).read_bytes() for name in bundle_files(show)} == before
    assert not_as_packed(show) == "" and not list(show.glob(".export-*"))


def two_shows(folder: Path) -> tuple[Path, Path]:
    """A show with an artist's own files, and within its folder the files that an export puts there."""
    show, made = folder / "show", folder / "show" / ".export-1" / "show"
    for place in (show / "phrases", show / "pictures", made):
        place.mkdir(parents=True)
        (place / "second.bvh").write_text("the artist's")
    for name in ("puppet.onnx", "answer.png"):
        (show / name).write_text("old")
    (made / "puppet.onnx").write_text("new")
    write_checksums(show)
    return show, made


def network_of(show: Path) -> str:
    """That of a show which is whole."""
    assert not checksum_problems(show) and not unlisted_files(show)
    assert {(show / name / "second.bvh").read_text() for name in ("phrases", "pictures")} == {"the artist's"}
    network = (show / "puppet.onnx").read_text()
    assert (show / "answer.png").exists() == (network == "old")
    return network


@contextlib.contextmanager
def before_each_step(look: Callable[[], object]) -> Iterator[None]:
    """Steps that may change the disk."""

    def profile(_: object, event: str, called: object) -> None:
        if event == "c_call" and getattr(called, "__module__", "") in ("posix", "io"):
            look()

    sys.setprofile(profile)
    try:
        yield
    finally:
        sys.setprofile(None)


def test_an_export_that_is_cut_at_any_step_leaves_one_whole_show(tmp_path: Path) -> None:
    """By a second Ctrl-C, or with the power; and the next export clears up."""
    show, made = two_shows(tmp_path / "uncut")
    seen: list[str] = []
    with before_each_step(lambda: seen.append(network_of(show))):
        release.put_in_place(made, show)
    assert seen[0] == "old" and network_of(show) == "new"
    for last in range(0, len(seen), len(seen) // 8):
        show, made = two_shows(tmp_path / str(last))
        steps = iter(range(last))

        def cut(steps: Iterator[int] = steps) -> None:
            if next(steps, None) is None:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt), before_each_step(cut):
            release.put_in_place(made, show)
        if network_of(show) == "old":
            release.put_in_place(made, show)
            assert network_of(show) == "new" and [one.name for one in show.parent.iterdir()] == ["show"]


def test_a_folder_in_which_a_shell_works_stays_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    show, made = two_shows(tmp_path)
    monkeypatch.chdir(show)
    release.put_in_place(made, show)
    assert network_of(Path()) == "new"


@pytest.mark.usefixtures("unmeasured")
def test_where_folders_cannot_be_exchanged_a_ctrl_c_waits_for_the_checksums(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    show = shutil.copytree(trained[0], tmp_path / "show")
    (show / "answer.png").write_bytes(b"of the dancer before")
    (show / ".export-killed" / "show").mkdir(parents=True)
    (show / "puppet.onnx").write_bytes(b"another network")
    write_checksums(show)
    replace_file, moved = Path.replace, list[str]()

    def replace(file: Path, target: Path) -> Path:
        if target.parent == show and file.parent != show:
            moved.append(target.name)
            if len(moved) == 2:
                signal.raise_signal(signal.SIGINT)
        return replace_file(file, target)

    def not_here(*_: Path) -> None:
        raise OSError

    monkeypatch.setattr(release, "exchange", not_here)
    monkeypatch.setattr(Path, "replace", replace)
    result = bunraku("export", show / "checkpoint.pt", "--out", show, "--name", "Other", "--hand", "head")
    assert result.exit_code == 0, said(result)
    assert "puppet.onnx" in moved and "show.yaml" not in moved
    assert "stays as it is: --name and --hand are for a new one" in said(result)
    assert verify_bundle(show) == [] and not (show / "answer.png").exists()
    assert not list(show.glob(".export-*")) and not (tmp_path / ".show.new").exists()


def test_a_wrong_hand_or_phrase_is_refused_before_anything_is_measured(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(release, "judge", lambda *_: pytest.fail("it measured first"))
    for option, value, named in (
        ("--hand", "tail", "No hand can hold 'tail'"),
        ("--phrase", "no.bvh", "no.bvh"),
    ):
        result = bunraku("export", trained[0], "--out", tmp_path / "show", option, value)
        assert result.exit_code == 2 and named in said(result)
    assert not (tmp_path / "show" / "puppet.onnx").exists()


@pytest.mark.usefixtures("unmeasured")
def test_where_the_gate_refuses_fp32_ships_and_the_report_says_so(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(gate.LIMITS_DEGREES, "10", 1e-6)
    result = bunraku("export", trained[0], "--out", tmp_path / "show")
    assert "fp32 ships" in said(result)
    report = json.loads((tmp_path / "show" / "report.json").read_text())
    assert report["network"]["ships"] == "fp32" and report["quantization"]["passed"] is False
    assert "fp32 ships" in report["quantization"]["message"]
    figures = bunraku("evaluate", tmp_path / "show", tmp_path / "show" / "phrase.bvh", "--json")
    assert json.loads(figures.stdout)["network"]["precision"] == "fp32"


@pytest.mark.usefixtures("unmeasured")
def test_a_stop_in_the_middle_says_how_to_go_on(tmp_path: Path, recordings: Path) -> None:
    out = tmp_path / "show"
    options = ["--width", "32", "--latent", "12", "--threads", "1", "--device", "cpu"]
    asked = ["train", "--recordings", str(recordings), "--out", str(out), "--steps", "100000", *options]
    process = subprocess.Popen(
        [sys.executable, "-m", "appliance.cli", *asked], stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "Ctrl-C stops" in line:
            process.send_signal(signal.SIGTERM)
            break
    output = process.stderr.read()
    assert process.wait() == 130
    assert "nothing is lost" in output and f"bunraku train --resume --out {out}" in output
    assert (out / "checkpoint.pt").exists() and not (out / "puppet.onnx").exists()

    again = bunraku("train", "--recordings", recordings, "--out", out, "--steps", 20)
    assert again.exit_code == 2 and "already has a training" in said(again)

    # One step is there already: only the show is still to be made.
    resumed = bunraku("train", "--resume", "--out", out, "--steps", 1)
    assert resumed.exit_code == 0, said(resumed)
    assert (out / "puppet.onnx").exists()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["train", "--out", "{tmp}/show"], "--recordings FOLDER"),
        (["train", "--out", "{tmp}/show", "--recordings", "{tmp}"], r"has no .bvh files"),
        (["train", "--out", "{tmp}/show", "--resume"], "no checkpoint.pt to resume"),
        (["train", "--out", "{tmp}/show", "--recordings", "{rec}", "--true-fps", "sixty"], "PATTERN=FPS"),
        (
            ["train", "--out", "{tmp}/show", "--recordings", "{rec}", "--steps", "2", "--minutes", "1"],
            "not both",
        ),
        (
            ["train", "--out", "{tmp}/show", "--recordings", "{rec}", "--held-out", "*"],
            "Every take is held out",
        ),
        (["export", "{tmp}/checkpoint.pt", "--out", "{tmp}/show"], "does not exist"),
        (["evaluate", "{tmp}/show", "{rec}/sway_0.bvh"], "does not exist"),
        (["evaluate", "{show}", "{rec}/sway_0.bvh", "--hands", "{rec}/sway_1.bvh"], "belong together"),
        (["evaluate", "{show}", "{rec}/sway_0.bvh", "--reference", "{rec}"], "belong together"),
        (["evaluate", "{show}", "{rec}/sway_0.bvh", "--joint", "head"], "give --hands as well"),
        ([*HANDS, "{rec}/sway_0.bvh"], "of the same take"),
        ([*HANDS, "{rec}/sway_1.bvh", "--joint", "tail"], "No hand can hold 'tail'"),
        ([*HANDS, "{rec}/sway_1.bvh", "--iterations", "ten"], "is no K/J"),
    ],
)
def test_what_people_can_mend_is_one_message(
    arguments: list[str], complaint: str, tmp_path: Path, recordings: Path, tiny_show: Path
) -> None:
    folders = {"tmp": tmp_path, "rec": recordings, "show": tiny_show}
    result = bunraku(*(argument.format(**folders) for argument in arguments))
    assert result.exit_code == 2
    assert complaint in said(result)
    assert "Traceback" not in result.output


def test_without_torch_the_command_says_what_to_install(tmp_path: Path) -> None:
    blocked = (
        "import sys; sys.modules['torch'] = None\n"
        "from appliance.studio.commands import app\n"
        f"app(['train', '--recordings', '.', '--out', {str(tmp_path / 'show')!r}])\n"
    )
    result = subprocess.run([sys.executable, "-c", blocked], capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "pip install bunraku-studio" in result.stderr and "Traceback" not in result.stderr


def test_a_show_is_evaluated_without_torch(tiny_show: Path) -> None:
    blocked = (
        "import sys; sys.modules['torch'] = None; sys.modules['onnx'] = None\n"
        "from appliance.studio.commands import app\n"
        f"app(['evaluate', {str(tiny_show)!r}, {str(tiny_show / 'phrase.bvh')!r}, '--json'])\n"
    )
    result = subprocess.run([sys.executable, "-c", blocked], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["degrees"]["1"]["mean"] > 0


UNIT = 0.031  # metres, which no guess knows
TOLD = ("--metres-per-unit", UNIT, "--facing", "-z")


@pytest.mark.usefixtures("quickly_written")
def test_later_commands_read_as_training_did_and_leave_what_they_made(tmp_path: Path) -> None:
    folder, out = tmp_path / "takes", tmp_path / "pose"
    folder.mkdir()
    for seed in range(2):
        dance = swaying(6.0, seed)
        dance.poses[:, 0] = quaternion.multiply(np.array([0.0, 0.0, 1.0, 0.0]), dance.poses[:, 0])
        write_bvh(folder / f"take_{seed}.bvh", dance, UNIT)
    trained = bunraku("train", "--model", "pose", "--recordings", folder, "--out", out, "--steps", 2, *TOLD)
    assert trained.exit_code == 0, said(trained)

    def wobbled(phrase: Path, name: str, *reported: object) -> Path:
        options = (
            "--model",
            out / "checkpoint.pt",
            "--out",
            tmp_path / name,
            "--wobble",
            0,
            1,
            "--seconds",
            1,
        )
        result = bunraku("path", phrase, *options, *reported)
        assert result.exit_code == 0, said(result)
        return tmp_path / name

    once = wobbled(folder / "take_0.bvh", "once.bvh")
    again = wobbled(once, "again.bvh")
    turned = wobbled(once, "turned.bvh", "--facing", "once=-z")
    written = read_bvh(folder / "take_0.bvh", metres_per_unit=UNIT).skeleton
    for made, front in ((once, 1), (again, 1), (turned, -1)):
        dance = read_bvh(made)
        np.testing.assert_allclose(dance.skeleton.offsets, written.offsets, atol=1e-4)
        ways = fronts(written, sampled_positions(dance))
        assert ways is not None and front * ways.mean(axis=0)[1] > 0.5, made.name


def test_what_was_asked_for_goes_before_what_is_remembered(tmp_path: Path) -> None:
    inches = Catalogue().with_options(ReadingOptions(metres_per_unit={"*": 0.0254}, all_frames=True))
    assert reading_facts(inches) == {"metres_per_unit": {"*": 0.0254}, "all_frames": True}
    write_bvh(tmp_path / "raw.bvh", swaying(1.0), 0.0254)
    write_bvh(tmp_path / "ours.bvh", swaying(1.0))
    trained = Remembered(inches.reading, read_bvh(tmp_path / "ours.bvh").skeleton)
    write_bvh(tmp_path / "at_another_rate.bvh", swaying(1.0, fps=60.0))

    def unit(name: str, **asked: float) -> float | None:
        reported = trained.options_for(tmp_path / name, ReadingOptions(metres_per_unit=asked))
        return reported.conventions_of(Path(name).stem).metres_per_unit

    assert unit("raw.bvh") == 0.0254 and unit("raw.bvh", raw=0.5) == 0.5
    assert unit("ours.bvh") is None and unit("ours.bvh", ours=0.5) == 0.5
    assert unit("at_another_rate.bvh") == 0.0254


@pytest.mark.parametrize(
    "joint", ["lShldr", "mixamorig:LeftArm", "Bip01 L UpperArm", "no", "Skeleton 001:Arm"]
)
def test_the_show_has_what_the_default_show_has(tmp_path: Path, joint: str) -> None:
    hand = {"sensor": "left-wrist", "joint": joint, "at_neutral": [0.766, 0.0, 0.0, -0.643]}
    path = write_show_yaml(tmp_path, "Anna: one", [hand], "Danced by Anna # and Bert.", "made of\nanna.bvh")
    text = path.read_text(encoding="utf-8")
    found, given = yaml.safe_load(text), yaml.safe_load((default_show_path() / "show.yaml").read_text())
    assert set(found) == set(given) - {"springs", "strings"}
    assert found["name"] == "Anna: one" and found["acknowledgement"] == "Danced by Anna # and Bert."
    assert found["hands"] == [hand]
    assert found["dancer"] == given["dancer"] and found["looks"] == given["looks"]
    assert found["cues"][0]["hands"] == [joint] and found["cues"][-1]["hands"] == [joint]
    assert "# made of anna.bvh" in text and text.count("#") > 8
    path.write_text("name: mine\n")
    write_show_yaml(tmp_path, "other", [hand])
    assert path.read_text() == "name: mine\n"


def test_a_show_s_own_phrase_is_no_recording(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer")
    before = recordings_in(folder)
    (folder / "phrase.bvh").write_text("HIERARCHY")
    assert folder / "phrase.bvh" in recordings_in(folder)
    (folder / "checkpoint.pt").touch()
    (folder / "skeleton.bvh").write_text("HIERARCHY")
    assert recordings_in(folder) == before
    assert "2 minutes of dance are enough to begin with" in few_data(load_dataset(folder))[0]
