"""Boxes in a network: what avahi prints, a box that is asked, and the examples for Prometheus and Grafana."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest
import yaml

from appliance.console.fleet import Neighbour, neighbours
from appliance.console.metrics import metrics
from appliance.levers.status import Status
from hw_sim.peers import HOST
from tests.console.page import page_alone

DEPLOY = Path(__file__).resolve().parents[2] / "deploy" / "monitoring"
# As avahi-browse 0.8 prints it: a box on two networks, one by IPv6, one that is only announced.
BROWSED = r"""+;eth0;IPv4;Bunraku\032on\032left;_bunraku._tcp;local
=;eth0;IPv4;Bunraku\032on\032left;_bunraku._tcp;local;left.local;192.0.2.5;8080;"version=0.2.0" "scheme=http"
=;wlan0;IPv4;Bunraku\032on\032left;_bunraku._tcp;local;left.local;10.0.0.5;8080;"version=0.2.0" "scheme=http"
=;eth0;IPv6;Bunraku\032on\032left;_bunraku._tcp;local;left.local;fe80::1;8080;"version=0.2.0"
=;eth0;IPv4;B\195\188hne;_bunraku._tcp;local;buehne.local;192.0.2.6;8443;"scheme=https" "version=0.1.9"
=;eth0;IPv4;odd;_bunraku._tcp;local;odd.local;192.0.2.7;port;
"""


def test_what_avahi_prints() -> None:
    assert neighbours(BROWSED) == [
        Neighbour("Bühne", "buehne.local", "192.0.2.6", 8443, "0.1.9", "https"),
        Neighbour("Bunraku on left", "left.local", "192.0.2.5", 8080, "0.2.0", "http"),
    ]


def test_a_box_that_is_found_is_asked_and_one_that_is_away_stays_in_the_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page asks itself: it is a box like any other. avahi's program is the only part that is made up."""
    programs = tmp_path / "bin"
    programs.mkdir()
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    with page_alone(tmp_path) as (page, _):
        assert page.get("/api/fleet").status == 401
        page.unlock()
        browser = programs / "avahi-browse"
        browser.write_text("#!/bin/sh\nexit 1\n")
        browser.chmod(0o755)
        answer = page.get("/api/fleet")
        assert (answer.status, "avahi-daemon" in answer.text) == (503, True)
        boxes = (("a", page.port), ("b", 9))
        lines = (f"=;lo;IPv4;{one};_bunraku._tcp;local;{one}.local;{HOST};{port};" for one, port in boxes)
        browser.write_text("#!/bin/sh\ncat <<'END'\n" + "\n".join(lines) + "\nEND\n")
        found = page.get("/api/fleet").value
    assert [one["host"] for one in found] == ["a.local", "b.local"]
    assert found[0]["verdict"]["key"] == "stage_absent"
    assert "verdict" not in found[1]


def test_the_examples_for_monitoring_name_metrics_that_there_are() -> None:
    sensor = {"name": "left-wrist", "heard": True, "rate_hz": 50.0, "loss": 0.0, "battery": 80}
    fallback = {"name": "tick-late", "process": "stage", "times": 1}
    status = Status(tick_p50_ms=1.0, tick_p99_ms=2.0, temperature_c=50.0, uptime_s=1.0)
    reported = metrics(
        {"status": status._asdict(), "frames": "fresh", "sensors": [sensor], "fallbacks": [fallback]}
    )
    known = set(re.findall(r"(?m)^(bunraku_\w+)", reported))
    dashboard = json.loads((DEPLOY / "grafana-dashboard.json").read_text())
    asked = {
        name
        for panel in dashboard["panels"]
        for target in panel["targets"]
        for name in re.findall(r"bunraku_\w+", target["expr"])
    }
    assert asked <= known
    assert len(asked) >= 9
    (job,) = yaml.safe_load((DEPLOY / "prometheus.yml").read_text())["scrape_configs"]
    assert job["metrics_path"] == "/metrics"
