"""The doctor's checks of what the box dances: shows and releases put aside, health, fallbacks."""

from __future__ import annotations

from pathlib import Path

from appliance.box.fallback import Fallen
from appliance.cli.doctor import box_state, storage
from appliance.cli.doctor.host_view import HostView, RunningStage
from appliance.release.choice import Aside, Choice
from tests.system.machine_of_files import lay, only


def lay_choice(root: Path, choice: Choice) -> None:
    lay(root, "run/bunraku/chosen.json")
    choice.write(root / "run/bunraku/chosen.json")


def test_a_refused_show_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(refused=("show.yaml:3: no such key.", "It is not danced.")))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert "show.yaml:3: no such key.\nIt is not danced." in found[1].message


def test_a_show_put_aside_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(aside=(Aside("new+", "The show did not dance."),)))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert found[1].message == "The show did not dance."


def test_a_box_that_is_on_and_does_not_dance_is_wrong(tmp_path: Path) -> None:
    assert only(box_state.stage(HostView(tmp_path))).verdict == "ok"
    lay_choice(tmp_path, Choice())
    assert only(box_state.stage(HostView(tmp_path))).verdict == "wrong"


def test_a_release_put_aside_is_reported(tmp_path: Path) -> None:
    lay(tmp_path, "/data/bunraku-releases/0.2.0.aside", "its stage did not dance\n")
    found = only(storage.releases(HostView(tmp_path)))
    assert found.verdict == "better"
    assert "0.2.0 is put aside: its stage did not dance. The release" in found.message
    assert "bunraku release use 0.2.0" in found.cure


def test_the_health_of_the_dance() -> None:
    health = {"rate_hz": 50.0, "ticks": 5000, "late": 3, "skipped": 0, "complaints": []}
    assert only(box_state.stage(HostView(stage=RunningStage(1, health)))).verdict == "ok"
    found = list(
        box_state.stage(HostView(stage=RunningStage(1, {**health, "late": 300, "complaints": ["No key."]})))
    )
    assert [one.verdict for one in found] == ["better", "better"]
    assert only(box_state.stage(HostView())).verdict == "ok"


def test_fallbacks_in_force_are_reported_with_their_words() -> None:
    reported = (
        ("stage", Fallen("sensor-silent", 3, True, "Sensor left-wrist is silent. Charge it.")),
        ("lights", Fallen("wire-gone", 1, False, "It is back.")),
    )
    found = list(box_state.stage(HostView(stage=RunningStage(1, {}, reported))))
    assert [(one.what, one.verdict, one.message, one.cure) for one in found[1:]] == [
        ("stage: sensor-silent", "wrong", "Sensor left-wrist is silent.", "Charge it.")
    ]
