"""bunraku train, evaluate, export: what an artist does, from recordings to a show that the box accepts."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import Result

from appliance.pose.bvh import read_bvh, write_bvh
from appliance.show.check import verify_bundle
from appliance.show.show import load_show
from appliance.studio.export import gate
from tests.studio.conftest import Said, bunraku
from tests.studio.tiny import swaying

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
        "60 steps on the CPU (1 thread)",
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
    assert reported["settings"]["width"] == 48 and reported["history"][-1]["step"] == 60
    assert reported["history"][-1]["held_out_degrees"] > 0
    for picture in (show / "pictures" / "losses.png", show / "report.png", show / "answer.png"):
        assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 10_000
    listed = (show / "SHA256SUMS").read_text()
    assert "puppet.onnx" in listed and "checkpoint.pt" not in listed and "pictures" not in listed


def test_the_report_holds_what_the_stage_and_the_artist_need(trained: Trained) -> None:
    report = json.loads((trained[0] / "report.json").read_text())
    assert report["network"]["ships"] in ("fp32", "int8")
    assert report["evaluated_on"] == ["sway_2"]
    assert report["training"]["steps"] == 60
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
