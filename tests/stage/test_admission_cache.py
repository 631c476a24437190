"""A stage that comes back takes the admission that was measured before it, if nothing has changed since."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import yaml

from appliance.show.box import BoxConfig, LimitsConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage import admission_cache as module
from appliance.stage.admission import Admission
from appliance.stage.admission_cache import admission_record, admitted
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show

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
    real = module.admission

    def counted(*given: object) -> Admission:
        times.append(1)
        return real(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "admission", counted)
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
