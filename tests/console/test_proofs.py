"""What is kept of proofs: numbered, whole, bounded; and what is asked for is bounded too."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from appliance.console.proofs import MOST, Proofs
from appliance.console.proving import Proving, Wanted
from appliance.console.show_goes import show_goes
from tests.console.page import Page


def test_the_newest_are_kept_and_a_spoilt_one_is_left_out(tmp_path: Path) -> None:
    proofs = Proofs(tmp_path / "proofs")
    assert proofs.listed() == []
    numbers = [proofs.add({"kind": "doctor", "made": float(n), "holds": True}) for n in range(MOST + 3)]
    assert [one["id"] for one in Proofs(tmp_path / "proofs").listed()] == numbers[:2:-1]
    (tmp_path / "proofs" / f"{numbers[-1]}.json").write_text('{"kind": ')
    proofs = Proofs(tmp_path / "proofs")
    assert [one["id"] for one in proofs.listed()] == numbers[-2:2:-1]
    assert proofs.content(numbers[-2]) and proofs.content(numbers[0]) is None
    assert proofs.content("../console") is None
    assert proofs.add({"kind": "doctor", "made": 0.0, "holds": True}) > numbers[-1]


@pytest.mark.parametrize(
    "said", ['{"kind": "rm", "seconds": 30}', '{"kind": "latency", "seconds": 9e9}', "[]", "{", '{"kind": 1}']
)
def test_what_is_wanted_is_one_of_two_things(tmp_path: Path, said: str) -> None:
    proving = Proving(tmp_path)
    proving.want(Wanted("latency", 30))
    assert proving.wanted() == Wanted("latency", 30)
    (tmp_path / "prove" / "wanted").write_text(said)
    assert proving.wanted() is None
    proving.end()
    assert proving.wanted() is None and not show_goes(tmp_path)


def test_a_prover_is_silent_by_a_clock_that_nobody_sets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proving = Proving(tmp_path)
    assert proving.is_silent()
    proving.want(Wanted("doctor", 30))
    proving.report(share=0.5)
    now, wall = time.monotonic(), time.time()
    monkeypatch.setattr(time, "time", lambda: wall + 7200.0)
    assert not proving.is_silent()
    monkeypatch.setattr(time, "time", lambda: wall - 7200.0)
    monkeypatch.setattr(time, "monotonic", lambda: now + 31.0)
    assert proving.is_silent()
    proving.report()
    assert not proving.is_silent()


@pytest.mark.parametrize(
    "said",
    [{}, {"kind": "latency", "seconds": 1}, {"kind": "latency", "seconds": "6"}, {"kind": []}],
)
def test_a_proof_needs_the_pin_and_its_bounds(page: Page, said: dict[str, Any]) -> None:
    assert page.post("/api/prove", said).status == 401
    assert page.post("/api/prove/end", {}).status == 401
    page.unlock()
    assert page.post("/api/prove", said).status == 400
    assert page.get("/api/prove/000001").status == 404
    assert page.get("/api/prove/progress?from=x").status == 400
