"""`bunraku learn`: pauses for a show, continues after a kill, offers only what reaches the bar."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from appliance.box.durable import write_whole
from appliance.cli import learn
from appliance.cli.learn import Learner
from appliance.cli.learned import figures_of, sentence_of
from appliance.console.learning import STUDIO_MISSING, Learning, Wanted
from appliance.show.bundle import default_show_path, named_show
from tests.command import Command
from tests.logged import said

# Stands for `bunraku`: trains until it is told that it may end; stops at SIGTERM with a checkpoint, as train.
PROGRAM = """
import json, pathlib, shutil, signal, sys, time
words = sys.argv[1:]
told = pathlib.Path({reported!r})
with told.open("a") as log:
    log.write(json.dumps(words) + "\\n")
if words[0] == "check":
    print("checked", words[1])
    sys.exit({check})
out = pathlib.Path(words[words.index("--out") + 1])
out.mkdir(parents=True, exist_ok=True)
signal.signal(signal.SIGTERM, lambda *_: ((out / "checkpoint.pt").touch(), sys.exit(130)))
share = 0.5 if "--resume" in words else 0.1
history = [{{"fraction": share, "held_out_degrees": 3.0}}]
(out / "training.json").write_text(json.dumps({{"history": history}}))
while not (told.parent / "may end").exists():
    time.sleep(0.01)
shutil.copy({report!r}, out / "report.json")
sys.exit({train})
"""


class Box:
    """A learning with a stand-in for the commands; dances: whether a show is on."""

    def __init__(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, report: Path, train: int = 0, check: int = 0
    ) -> None:
        self.learning, self.reported, self.dances = Learning(folder / "learning"), folder / "told", False
        program = PROGRAM.format(reported=str(self.reported), report=str(report), train=train, check=check)
        monkeypatch.setattr(learn, "BUNRAKU", (sys.executable, "-c", program))
        monkeypatch.setattr(learn, "require_studio", lambda: None)
        monkeypatch.setattr(learn, "_LOOK_S", 0.02)
        self.folder, self.said = folder, said
        self.show_before = {path.name: path.read_bytes() for path in default_show_path().glob("*.yaml")}

    def let_end(self) -> None:
        (self.folder / "may end").touch()

    def run(self) -> int:
        return Learner(self.learning, lambda: self.dances).run()

    def begun(self) -> list[list[str]]:
        return (
            [json.loads(line) for line in self.reported.read_text().splitlines()]
            if self.reported.exists()
            else []
        )

    def await_(self, is_so: Callable[[], Any]) -> None:
        while not is_so():
            time.sleep(0.005)

    def beside(self, script: Callable[[], None]) -> threading.Thread:
        """Signals reach the main thread, in which the learner runs."""
        thread = threading.Thread(target=script, daemon=True)
        thread.start()
        return thread


def report_of(show: str, folder: Path, **changed: float) -> Path:
    """The report of a show that comes with the box, with other figures."""
    report = json.loads((named_show(Path(show)) / "report.json").read_text())
    report["puppetry"]["lShldr"]["10_9"].update(changed)
    path = folder / f"{show}.json"
    path.write_text(json.dumps(report))
    return path


def test_what_reaches_the_bar_is_offered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes", 60.0))
    box.let_end()
    assert box.run() == 0
    reported = box.learning.reported()
    assert reported["state"] == "learned" and "reaches the bar" in reported["message"]
    assert all(one["holds"] for one in reported["figures"]) and box.learning.wanted() is None
    train, check = box.begun()
    assert train[:1] == ["train"] and train[train.index("--minutes") + 1] == "52.5"
    assert "--from" not in train
    assert check == ["check", str(box.learning.show)]


def test_a_short_time_leaves_a_quarter_for_the_rest_and_the_show_that_it_begins_with_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes", 12.0, "martial"))
    box.let_end()
    assert box.run() == 0
    train = box.begun()[0]
    assert train[train.index("--minutes") + 1] == "9" and train[train.index("--from") + 1] == "martial"


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"answer": 0.0}, "answer (degrees) 0.0 (at least 8)"),  # a copy of the phrase
        (
            {"energy_legs": 0.0, "spread_legs": 0.0, "critic": 1.0},
            "critic 1.0 (at most 0.9)",
        ),  # the mean pose
        ({"plausibility": 1.19}, "plausibility 1.19 (at most 1.1)"),  # the hand's joint pasted on
    ],
)
def test_null_products_do_not_reach_it_and_the_show_stays(
    changed: dict[str, float], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path, **changed))
    box.learning.begin(Wanted("takes"))
    box.let_end()
    assert box.run() == 1
    reported = box.learning.reported()
    assert reported["state"] == "worse" and named in reported["message"]
    assert "The show that danced before stays." in reported["message"] and reported["advice"]


def test_the_shows_that_come_with_the_box_stand_on_both_sides_of_the_bar() -> None:
    reports = [
        json.loads((named_show(Path(name)) / "report.json").read_text()) for name in ("default", "martial")
    ]
    reached, failed = (figures_of(report) for report in reports)
    assert all(one["holds"] for one in reached) and "is offered" in sentence_of(reached)
    assert not all(one["holds"] for one in failed)


def test_a_machine_too_slow_for_a_critic_is_judged_by_the_other_figures(tmp_path: Path) -> None:
    for show, passes in (("default", True), ("martial", False)):
        report = json.loads(report_of(show, tmp_path).read_text())
        report["puppetry"]["lShldr"]["10_9"]["critic"] = None
        figures = figures_of(report)
        assert "critic" not in [one["name"] for one in figures]
        assert all(one["holds"] for one in figures) is passes
        report["puppetry"]["lShldr"]["10_9"]["energy_legs"] = None
        assert not all(one["holds"] for one in figures_of(report))


def test_it_pauses_while_a_show_dances_and_goes_on_from_the_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes"))
    states = []

    def script() -> None:
        box.await_(lambda: box.learning.reported().get("share") == 0.1)
        box.dances = True
        box.await_(lambda: box.learning.reported()["state"] == "waits")
        states.append(len(box.begun()))
        box.dances = False
        box.await_(lambda: box.learning.reported().get("share") == 0.5)
        box.let_end()

    thread = box.beside(script)
    assert box.run() == 0
    thread.join()
    assert states == [1], "nothing is trained meanwhile"
    first, second, check = box.begun()
    assert "--resume" not in first and "--recordings" in first
    assert "--resume" in second and "--recordings" not in second and check[0] == "check"


def test_a_show_that_starts_while_it_exports_is_a_pause_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_handler = PROGRAM[PROGRAM.index("signal.signal(") : PROGRAM.index("share =")]
    exports = PROGRAM.replace(own_handler, '(out / "checkpoint.pt").touch()\n')  # SIGTERM ends it at once
    monkeypatch.setattr(sys.modules[__name__], "PROGRAM", exports)
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes"))

    def script() -> None:
        box.await_(lambda: box.learning.reported().get("share") == 0.1)
        box.dances = True
        box.await_(lambda: box.learning.reported()["state"] != "training")
        box.dances = False
        box.let_end()

    box.beside(script)
    assert box.run() == 0 and box.learning.reported()["state"] == "learned"
    assert [words[0] for words in box.begun()] == ["train", "train", "check"]
    assert "--resume" in box.begun()[1]


def test_a_stopped_learner_continues_with_the_same_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes"))

    def script() -> None:
        box.await_(lambda: box.learning.reported().get("share") == 0.1)
        signal.raise_signal(signal.SIGTERM)

    box.beside(script)
    assert box.run() == 2 and box.learning.wanted() == Wanted("takes")
    box.let_end()
    assert box.run() == 0 and "--resume" in box.begun()[1]


def test_what_the_page_ends_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.begin(Wanted("takes"))

    def script() -> None:
        box.await_(lambda: box.learning.reported().get("share") == 0.1)
        box.learning.end()

    box.beside(script)
    assert box.run() == 2 and len(box.begun()) == 1
    assert box.learning.reported() == {"state": "ended"}


@pytest.mark.parametrize(
    ("train", "check", "named"), [(2, 0, "training ended early"), (0, 2, "does not pass its check: checked")]
)
def test_a_failure_is_told_and_nothing_is_offered(
    train: int, check: int, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path), train, check)
    box.learning.begin(Wanted("takes"))
    box.let_end()
    assert box.run() == 1
    assert box.learning.reported()["state"] == "failed" and named in box.learning.reported()["message"]
    assert "The show that danced before stays." in box.said[-1] and box.learning.wanted() is None


def test_without_the_studio_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    learning = Learning(tmp_path)
    learning.begin(Wanted("takes"))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert Learner(learning, lambda: False).run() == 1
    assert learning.reported() == {"state": "failed", "message": STUDIO_MISSING}


def test_a_broken_box_file_is_said_once_and_learning_goes_on_when_it_is_mended(tmp_path: Path) -> None:
    """An end would be answered by systemd with another start, for ever."""
    box_file = tmp_path / "box.yaml"
    whole = f"runtime: {tmp_path / 'run'}\nstate: {tmp_path / 'state'}\n"
    box_file.write_text(whole + "colour: red\n")
    command = [sys.executable, "-m", "appliance.cli.learn", "--box", str(box_file)]
    learner = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert learner.stdout is not None
    assert "the box file cannot be read" in learner.stdout.readline()
    assert "Unknown key 'colour'" in learner.stdout.readline()
    with pytest.raises(subprocess.TimeoutExpired):
        learner.wait(2.0)
    request = tmp_path / "state" / "learning" / "wanted.json"
    request.parent.mkdir(parents=True)
    request.write_text('{"recordings": ')
    box_file.write_text(whole)
    assert learner.wait() == 0, "nothing that can be read is wanted here"
    assert not request.exists()
    assert "the box file cannot be read" not in learner.stdout.read()


@pytest.mark.parametrize("cut", ["rename", "second request"])
def test_a_power_cut_as_learning_begins_loses_no_show(
    cut: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = Box(tmp_path, monkeypatch, report_of("default", tmp_path))
    box.learning.show.mkdir(parents=True)
    (box.learning.show / "checkpoint.pt").touch()
    with monkeypatch.context() as patched:
        written: list[Path] = []

        def lost(self: Path, target: Path) -> None:
            raise KeyboardInterrupt

        def written_once(path: Path, content: bytes, private: bool = False) -> None:
            if path.name == "wanted.json" and path in written:
                raise KeyboardInterrupt
            written.append(path)
            write_whole(path, content, private)

        if cut == "rename":
            patched.setattr(Path, "rename", lost)
        else:
            patched.setattr("appliance.console.request_folder.write_whole", written_once)
        with pytest.raises(KeyboardInterrupt):
            box.learning.begin(Wanted("takes", 60.0, str(box.learning.show)))
    box.let_end()
    assert box.run() == 0
    train, _ = box.begun()
    assert train[train.index("--from") + 1] == str(box.learning.before) and "--resume" not in train
    assert (box.learning.before / "checkpoint.pt").exists()


def test_a_power_cut_before_learning_begins_leaves_the_last_show_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learning = Learning(tmp_path)
    learning.report(state="learned")
    learning.show.mkdir()

    def cut(path: Path, content: bytes) -> None:
        if path.name == "wanted.json":
            raise KeyboardInterrupt
        write_whole(path, content)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("appliance.console.request_folder.write_whole", cut)
        learning.begin(Wanted("takes", 60.0, str(learning.show)))
    assert learning.wanted() is None and learning.playable() == learning.show
    learning.want(Wanted("takes", 60.0, str(learning.show)))
    assert learning.reported() == {"state": "waits"} and learning.playable() is None


def test_a_power_cut_while_the_last_show_is_deleted_offers_no_half_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learning = Learning(tmp_path)
    learning.report(state="learned")
    learning.show.mkdir()
    assert learning.playable() == learning.show

    def cut(folder: Path, **_: object) -> None:
        if folder == learning.show:
            raise KeyboardInterrupt

    monkeypatch.setattr(shutil, "rmtree", cut)
    with pytest.raises(KeyboardInterrupt):
        learning.begin(Wanted("takes"))
    assert learning.playable() is None and learning.wanted() is None


def test_other_recordings_are_refused_while_some_are_learned(tmp_path: Path, bunraku: Command) -> None:
    Learning(tmp_path).want(Wanted("/others"))
    said = bunraku("learn", "--recordings", tmp_path, "--out", tmp_path, status=2).err
    assert "other recordings are being learned there" in said


def test_from_recordings_to_a_verdict_by_the_real_commands(tmp_path: Path, long_run: bool) -> None:
    """Six steps teach nothing, and it says so. Killed in between, it goes on."""
    if not long_run:
        pytest.skip("takes 45 s of processor time: --long")
    from tests.studio.tiny import write_recordings

    recordings, out = write_recordings(tmp_path / "takes"), tmp_path / "out"
    command = [sys.executable, "-m", "appliance.cli", "learn", "--recordings", recordings, "--out", out]
    sizes = ["--nice", "0", "--", "--steps", "6", "--batch", "64", "--width", "32", "--network", "mlp"]
    first = subprocess.Popen([*map(str, command), *sizes])
    while not (out / "show" / "pictures").exists():
        time.sleep(0.05)
    first.kill()
    first.wait()
    done = subprocess.run([*map(str, command), *sizes], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert "It does not reach the bar" in done.stdout and "The show that danced before stays." in done.stdout
    reported = Learning(out).reported()
    assert reported["state"] == "worse" and (out / "show" / "puppet.onnx").exists()
    assert next(one for one in reported["figures"] if one["name"] == "answer (degrees)")["value"] < 1.0
