"""Admission measures the puppet and lowers the iterations to what the tick can hold."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import yaml

from appliance.show.box import BoxConfig, LimitsConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage import admission_cache as module
from appliance.stage.admission import PACED, Admission, SecondLook, admit
from appliance.stage.admission_cache import admission_record, admitted
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show
from tests.fake_clock import FakeTime


class Puppet:
    """Costs a fixed time a pass on a fake clock."""

    def __init__(self, time: FakeTime, pass_ms: float, base_ms: float = 0.1) -> None:
        self.time, self.pass_ms, self.base_ms = time, pass_ms, base_ms
        self.runs: list[tuple[int, int]] = []

    def dance(self, coding: int, interaction: int) -> None:
        self.runs.append((coding, interaction))
        self.time.work((self.base_ms + coding * self.pass_ms) / 1000.0)


def test_a_show_that_fits_is_admitted_as_it_is() -> None:
    time = FakeTime()
    puppet = Puppet(time, pass_ms=0.1)
    admission = admit(puppet.dance, 10, 9, 10.0, clock=time.monotonic)
    assert admission.fits
    assert (admission.coding, admission.interaction) == (10, 9)
    assert admission.p99_ms == pytest.approx(PACED * 1.1)
    assert 40 <= admission.most_coding <= 50


def test_a_show_that_does_not_fit_is_lowered_to_the_most_that_does_and_keeps_its_free_pass() -> None:
    time = FakeTime()
    puppet = Puppet(time, pass_ms=1.0)
    admission = admit(puppet.dance, 10, 9, 10.0, clock=time.monotonic)
    assert not admission.fits
    assert (admission.coding, admission.interaction) == (4, 3)  # 2 * (0.1 + 4) = 8.2 ms fits, 5 would be 10.2
    assert "10 coding iterations do not fit" in admission.sentence()
    assert "runs with 4, 3 of them" in admission.sentence()
    assert "to 4" in admission.sentence()


def test_what_was_lowered_has_been_measured_not_only_extrapolated() -> None:
    time = FakeTime()
    puppet = Puppet(time, pass_ms=1.0)
    admission = admit(puppet.dance, 10, 9, 10.0, clock=time.monotonic)
    assert (admission.coding, admission.interaction) in puppet.runs


def test_a_cost_that_is_no_straight_line_is_lowered_until_it_really_fits() -> None:
    time = FakeTime()

    def dance(coding: int, interaction: int) -> None:
        time.work((0.5 if coding < 3 else 6.0) / 1000.0)

    admission = admit(dance, 12, 6, 10.0, clock=time.monotonic)
    assert admission.coding == 2
    assert admission.interaction == 0
    assert "The hands move nothing." in admission.sentence()


def test_one_iteration_runs_even_if_it_does_not_fit() -> None:
    time = FakeTime()
    admission = admit(Puppet(time, pass_ms=40.0).dance, 10, 10, 10.0, clock=time.monotonic)
    assert (admission.coding, admission.interaction) == (1, 1)
    assert not admission.fits


def test_a_heavy_network_does_not_hold_up_the_start() -> None:
    time = FakeTime()
    admit(Puppet(time, pass_ms=20.0).dance, 10, 9, 10.0, clock=time.monotonic)
    assert time.now - 1000.0 < 12.0


def test_the_slowest_run_counts_not_the_usual_one() -> None:
    time = FakeTime()
    runs = iter(range(10_000))

    def dance(coding: int, interaction: int) -> None:
        time.work(0.02 if next(runs) % 20 == 19 else 0.001)

    admission = admit(dance, 1, 1, 10.0, clock=time.monotonic)
    assert admission.p50_ms == pytest.approx(2.0)
    assert admission.p99_ms == pytest.approx(40.0)


@pytest.mark.parametrize("at", [20, 80])
def test_one_hiccup_that_fits_the_budget_does_not_limit_the_show(at: int) -> None:
    """Another program came between for 4 ms: in the runs at the show's iterations, or at one."""
    time = FakeTime()
    quiet = admit(Puppet(time, pass_ms=0.2).dance, 3, 2, 10.0, clock=time.monotonic)
    puppet = Puppet(time, pass_ms=0.2)

    def dance(coding: int, interaction: int) -> None:
        puppet.dance(coding, interaction)
        if len(puppet.runs) == at:
            time.work(0.004)

    admission = admit(dance, 3, 2, 10.0, clock=time.monotonic)
    assert admission.most_coding == quiet.most_coding
    assert admission.p99_ms == pytest.approx(quiet.p99_ms)


def test_a_network_that_is_slow_now_and_then_within_the_budget_is_measured_as_it_is() -> None:
    time = FakeTime()
    runs = iter(range(10_000))

    def dance(coding: int, interaction: int) -> None:
        time.work(0.004 if next(runs) % 20 == 19 else 0.001)

    assert admit(dance, 1, 1, 10.0, clock=time.monotonic).p99_ms == pytest.approx(8.0)


def test_other_programs_do_not_lower_a_show() -> None:
    """Measured by the processor time of the thread: what sleeps, or waits for its turn, costs nothing."""
    admission = admit(lambda coding, interaction: time.sleep(0.002), 3, 2, 1.0)
    assert admission.fits


def test_a_show_that_was_lowered_is_danced_whole_after_ten_seconds_in_which_it_would_have_fitted() -> None:
    look = SecondLook(lowered(5.0))
    assert [look.most_that_fits(slowest_ms=2.0, coding=2) for _ in range(12)] == [*[0] * 9, 10, 0, 0]


def test_a_second_in_which_it_would_not_have_fitted_begins_the_ten_anew() -> None:
    look = SecondLook(lowered(5.0))
    slowest_ms = [*[2.0] * 8, 2.6, *[2.0] * 10]
    assert [look.most_that_fits(ms, coding=2) for ms in slowest_ms] == [*[0] * 18, 10]


def test_a_show_that_fitted_is_not_looked_at_again() -> None:
    look = SecondLook(lowered(0.2))
    assert not any(look.most_that_fits(slowest_ms=2.0, coding=8) for _ in range(30))


def lowered(pass_ms: float) -> Admission:
    """A show of eight iterations that cost this much each, of a budget of 10 ms."""
    time = FakeTime()
    return admit(Puppet(time, pass_ms=pass_ms).dance, 8, 7, 10.0, clock=time.monotonic)


BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_show(tmp_path / "show")


@pytest.fixture
def cast(bundle: Path) -> Iterator[StageParts]:
    cast = assemble(load_show(bundle), BOX)
    yield cast
    cast.close()


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for each measurement."""
    times: list[int] = []
    real = module.measure_admission

    def counted(*given: object) -> Admission:
        times.append(1)
        return real(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "measure_admission", counted)
    return times


def test_measured_at_a_fresh_start_and_taken_at_a_return(
    cast: StageParts, bundle: Path, tmp_path: Path, measured: list[int]
) -> None:
    first = admitted(tmp_path, cast, BOX, comes_back=False)
    assert admitted(tmp_path, cast, BOX, comes_back=True) == first
    assert len(measured) == 1
    admitted(tmp_path, cast, BOX, comes_back=False)
    assert len(measured) == 2


def test_whatever_changes_is_measured(
    cast: StageParts, bundle: Path, tmp_path: Path, measured: list[int]
) -> None:
    admitted(tmp_path, cast, BOX, comes_back=False)
    slower = BOX.model_copy(update={"limits": LimitsConfig(tick_budget_ms=3.0)})
    assert admitted(tmp_path, cast, slower, comes_back=True).budget_ms == 3.0
    values = yaml.safe_load((bundle / "show.yaml").read_text())
    values["dancer"]["coding_iterations"] = 5
    (bundle / "show.yaml").write_text(yaml.safe_dump(values))
    cast = assemble(load_show(bundle), BOX)
    assert admitted(tmp_path, cast, slower, comes_back=True).asked_coding == 5
    network = bundle / "puppet.onnx"
    network.write_bytes(network.read_bytes())
    admitted(tmp_path, cast, slower, comes_back=True)
    assert len(measured) == 4
    cast.close()


@pytest.mark.parametrize("content", [b"", b"{}", b"[1]", b'{"coding": 3}', b"\xff\xfe"])
def test_what_cannot_be_read_is_measured(
    cast: StageParts, bundle: Path, tmp_path: Path, measured: list[int], content: bytes
) -> None:
    admitted(tmp_path, cast, BOX, comes_back=False)
    record = admission_record(cast, BOX)
    with closing(record.writer(tmp_path)) as block:
        block.write(content)
    admitted(tmp_path, cast, BOX, comes_back=True)
    assert len(measured) == 2
    (tmp_path / record.name).write_bytes(content)
    admitted(tmp_path, cast, BOX, comes_back=True)
    assert len(measured) == 3


def test_a_folder_that_takes_no_file_costs_nothing_but_time(
    cast: StageParts, bundle: Path, tmp_path: Path
) -> None:
    (tmp_path / admission_record(cast, BOX).name).mkdir()
    assert admitted(tmp_path, cast, BOX, comes_back=True).coding >= 1
