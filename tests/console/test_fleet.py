"""Boxes in a network: what avahi prints, a box that is asked, and the examples for Prometheus and Grafana."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import socket
import stat
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from appliance.console.fleet import Neighbour, asked, neighbours
from appliance.console.metrics import metrics
from appliance.console.push import PASSES, REFUSED, Pass, Passes, push
from appliance.console.venue import Venue
from appliance.levers.status import Status
from appliance.release.choice import CHOSEN, Choice, ShowAndBox
from appliance.release.packed_show import pack_show, require_known_maker, unpack_show
from appliance.show.bundle import CHECKSUMS, SIGNATURE, write_checksums
from appliance.stage.stage_error import StageError
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.console.page import Page, box_with_page, page_alone
from tests.system.processes import BUNRAKU, Process, run_bunraku, wait_until

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

        def answered() -> Any:
            """Again where it was slow to answer itself."""
            found = page.get("/api/fleet").value
            return found if "verdict" in found[0] else None

        found = wait_until(answered)
    assert [one["host"] for one in found] == ["a.local", "b.local"]
    assert found[0]["verdict"]["key"] == "stage_absent"
    assert "verdict" not in found[1]


def test_an_answer_in_several_parts_is_read_to_its_end(tmp_path: Path) -> None:
    """As a long refusal comes over a network; and no box takes the others out of the list."""
    refusal = json.dumps({"problems": [{"message": "It is too slow."}] * 200}).encode()
    passes = Passes(tmp_path / PASSES)
    (tmp_path / "show.zip").write_bytes(b"packed")
    said = {"verdict": {"key": "well"}, "status": {"show": "A", "cue": "storm"}}
    bodies = {
        "status": json.dumps(said).encode(),
        "odd": b'{"verdict": {}, "status": [1]}',
        "deep": b"[" * 9000,
    }

    async def answer(request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse()
        await response.prepare(request)
        body = refusal if request.method == "POST" else bodies[request.path.split("/")[1]]
        for part in (body[:100], body[100:]):
            await response.write(part)
            await asyncio.sleep(0.05)
        return response

    async def main() -> None:
        app = web.Application()
        app.add_routes([web.post("/{path:.*}", answer), web.get("/{path:.*}", answer)])
        async with TestServer(app) as server:
            assert server.port is not None
            one = Neighbour("a", "a.local", HOST, server.port)
            passes.keep(one.key, Pass("token"))
            pushed = await push(one, tmp_path / "show.zip", passes, "", "b")
            assert (pushed.state, pushed.message[:30]) == (REFUSED, "It is too slow. It is too slow")
            found = await asked(
                [one, *(_At("a", "a.local", HOST, server.port, path) for path in ("odd", "deep"))]
            )
            assert [(one.get("verdict"), one.get("cue")) for one in found] == [
                ({"key": "well"}, "storm"),
                ({}, ""),
                (None, None),
            ]

    asyncio.run(main())


class _At(Neighbour):
    """One whose page is below a path, which is its version here."""

    @property
    def origin(self) -> str:
        return f"{super().origin}/{self.version}"


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


def test_a_counter_of_a_long_season_is_told_to_the_last_tick() -> None:
    reported = metrics({"status": Status(late=1_234_567, uptime_s=8_640_001.0)._asdict()})
    assert "bunraku_late_ticks_total 1234567\n" in reported
    assert "bunraku_uptime_seconds 8640001\n" in reported


def packed_bundle(folder: Path, name: str, network: str = "plain") -> Path:
    show = write_show(folder, hands=[], network=network, name=name)
    write_checksums(show)
    return show


class Installed(NamedTuple):
    """The page of an installed box without a stage, and the folders of its preflight."""

    page: Page
    data: Path
    run: Path

    @property
    def chosen(self) -> Choice:
        choice = Choice.read(self.run / CHOSEN)
        assert choice is not None
        return choice

    @property
    def dances(self) -> str:
        name: str = yaml.safe_load((self.chosen.first.show / "show.yaml").read_text())["name"]
        return name


def answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection((HOST, port), 1.0):
        return True
    return False


@contextlib.contextmanager
def installed(folder: Path, **console: object) -> Iterator[Installed]:
    (port,) = free_ports(1, socket.SOCK_STREAM)
    data, run = folder / "data", folder / "run"
    for one in (data / "boxes", run):
        one.mkdir(mode=0o700, parents=True)
    box_file = data / "boxes" / "hall.yaml"
    settings = {"console": {"port": port, **console}, "control": None}
    box_file.write_text(yaml.safe_dump(settings | {"runtime": str(run), "state": str(data / "state")}))
    show = packed_bundle(data / "shows" / "before", "before")
    choice = Choice((ShowAndBox(show, box_file, "before+hall", "show from the stick", True),), data=data)
    for place in (data, run):
        choice.write(place / CHOSEN)
    with Process(folder / "page.txt", [*BUNRAKU, "console", "--chosen", run / CHOSEN]) as process:
        page = Page(port, box_file)
        wait_until(lambda: answers(port), lambda: process.output)
        yield Installed(page, data, run)


def test_three_boxes_get_the_show_and_each_tells_what_came_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One takes it, one has it already, one knows no maker of it, and one is away; avahi is made up."""
    keys = tmp_path / "shows.keys"
    keys.write_text("ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIJLsLqmXDzuE9Q1kH1bZ0Q8VvFzSXQ0Y2jdZ6zK0t3pN anna\n")
    programs = tmp_path / "bin"
    programs.mkdir()
    monkeypatch.setenv("PATH", f"{programs}:/usr/bin:/bin")
    show = packed_bundle(tmp_path / "tonight", "tonight")
    (tmp_path / "own").mkdir()
    with (
        installed(tmp_path / "left") as left,
        installed(tmp_path / "right", show_keys=str(keys)) as right,
        box_with_page(show, tmp_path / "own", has_sensors=False) as (_, own),
    ):
        boxes = {"left": left.page.port, "right": right.page.port, "away": 9}
        lines = [f"=;lo;IPv4;{one};_bunraku._tcp;local;{one}.local;{HOST};{at};" for one, at in boxes.items()]
        browser = programs / "avahi-browse"
        browser.write_text("#!/bin/sh\ncat <<'END'\n" + "\n".join(lines) + "\nEND\n")
        browser.chmod(0o755)

        def push(name: str, pin: str = "") -> tuple[str, str]:
            answer = own.post("/api/fleet/push", {"host": f"{name}.local", "pin": pin})
            assert answer.status == 200, answer.text
            return answer.value["state"], answer.value["message"]

        def pushed(name: str, pin: str = "") -> tuple[str, str]:
            """To a box that is there: again where a busy machine let it be silent for five seconds."""

            def reached() -> tuple[str, str] | None:
                state, message = push(name, pin)
                return None if state == "unreachable" else (state, message)

            return wait_until(reached, f"{name} is never reached")

        assert own.post("/api/fleet/push", {"host": "left.local"}).status == 401
        own.unlock()
        assert own.post("/api/fleet/push", {"host": "left.local"}).status == 404, "nobody looked for it"
        assert len(own.get("/api/fleet").value) == 3
        assert pushed("left") == ("pin", "")
        wrong = f"{(int(left.page.pin) + 1) % 1_000_000:06}"
        assert pushed("left", wrong)[0] == "pin" and left.dances == "before"
        state, message = pushed("left", left.page.pin)
        assert (state, left.dances) == ("taken", "tonight"), message
        assert left.chosen.first.source == "show from another box"
        assert [one.source for one in left.chosen.pairs[:2]] == [
            "show from another box",
            "show from the stick",
        ]
        assert pushed("left") == ("taken", "This show counts already."), "the PIN is given once"
        wait_until((left.run / "anew").exists)
        state, message = pushed("right", right.page.pin)
        assert state == "refused" and "not signed" in message
        assert right.dances == "before" and not any(right.data.rglob("show.zip"))
        assert push("away")[0] == push("away", "123456")[0] == "unreachable"
        (passes,) = (tmp_path / "own").rglob(PASSES)
        assert stat.S_IMODE(passes.stat().st_mode) == 0o600
        assert list(json.loads(passes.read_text())) == [
            f"{one}.local:{boxes[one]}" for one in ("left", "right")
        ]
        left.page.unlock()
        (device,) = [
            one for one in left.page.get("/api/devices").value if one["name"] == socket.gethostname()
        ]
        assert left.page.post("/api/revoke", {"id": device["id"]}).status == 200
        assert pushed("left")[0] == "pin", "the right to push can be taken back"


def test_a_broken_or_torn_show_leaves_a_box_as_it_was(tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    pack_show(packed_bundle(tmp_path / "show", "broken", network="broken"), broken)
    whole = broken.read_bytes()
    with installed(tmp_path / "left") as left:
        assert left.page.post("/api/show", whole).status == 401
        left.page.unlock()
        before = left.run.joinpath(CHOSEN).read_bytes()
        for body in (whole[: len(whole) // 2], b"", b"no zip"):
            answer = left.page.post("/api/show", body)
            assert answer.status == 404 and "did not arrive whole" in answer.text
        torn = socket.create_connection((HOST, left.page.port))
        head = f"POST /api/show HTTP/1.1\r\nHost: {HOST}:{left.page.port}\r\nOrigin: {left.page.origin}\r\n"
        head += f"Cookie: {left.page.cookie}\r\nContent-Length: {len(whole)}\r\n\r\n"
        torn.sendall(head.encode() + whole[:1000])
        wait_until(lambda: any(left.data.rglob("show.zip")))
        torn.close()
        wait_until(lambda: not any(left.data.rglob("show.zip")), "a half file stays")
        (tmp_path / "show" / "puppet.onnx").write_bytes(b"damaged")
        pack_show(tmp_path / "show", broken)
        problems = left.page.post("/api/show", broken.read_bytes()).value["problems"]
        assert any("puppet.onnx" in one["message"] for one in problems), problems
        assert left.run.joinpath(CHOSEN).read_bytes() == before
        assert not (left.run / "anew").exists() and left.dances == "before"
        assert not any(left.data.rglob("arrived")), "what came is taken away"


def test_the_command_sends_a_show_and_asks_for_a_pin(tmp_path: Path) -> None:
    show = packed_bundle(tmp_path / "tonight", "tonight")
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump({"runtime": str(tmp_path / "run"), "state": str(tmp_path / "state")}))
    with installed(tmp_path / "left", https=True, names=["left.hall"]) as left:
        at = f"https://{HOST}:{left.page.port}"
        command = ("fleet", "push", show, "--box", own, "--to", at)

        def reached() -> subprocess.CompletedProcess[str] | None:
            """As `pushed`."""
            done = run_bunraku(*command, stdin=f"{left.page.pin}\n")
            return None if "unreachable" in done.stdout else done

        done = wait_until(reached)
        assert done.returncode == 0 and "taken" in done.stdout, done
        assert left.dances == "tonight"
        again = run_bunraku(*command, "--to", f"{HOST}:9")
        assert again.returncode == 1
        assert "counts already" in again.stdout and "unreachable" in again.stdout


def test_a_show_from_elsewhere_is_its_maker_s(tmp_path: Path) -> None:
    """Signed by ssh-keygen as people do it; a copy, another key, a file more and no signature are refused."""
    for name in ("anna", "other"):
        command = ("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / name)
        subprocess.run(command, check=True)
    show, keys = packed_bundle(tmp_path / "made", "signed"), tmp_path / "keys"
    keys.write_text((tmp_path / "anna.pub").read_text())

    def verdict() -> str:
        pack_show(show, tmp_path / "show.zip")
        (tmp_path / "into").mkdir(exist_ok=True)
        unpack_show(tmp_path / "show.zip", tmp_path / "into")
        try:
            require_known_maker(tmp_path / "into" / "show", keys)
        except StageError as error:
            return str(error)
        return ""

    def sign(name: str) -> None:
        (show / SIGNATURE).unlink(missing_ok=True)
        command = ("ssh-keygen", "-q", "-Y", "sign", "-n", "bunraku-show", "-f", tmp_path / name)
        subprocess.run((*command, show / CHECKSUMS), check=True, capture_output=True)

    assert "not signed" in verdict()
    sign("other")
    assert "not known" in verdict()
    sign("anna")
    assert verdict() == ""
    (show / "more.yaml").write_text("more")
    assert "more.yaml" in verdict()
    write_checksums(show)
    assert "not known" in verdict(), "the signature is of the checksums before"
    sign("anna")
    assert verdict() == ""


@pytest.mark.parametrize(
    "name", ["../show.yaml", "/etc/show.yaml", "bunraku/show/../../x", "bunraku/box.yaml", "bunraku/show/"]
)
def test_a_hostile_zip_writes_nothing_beside_its_folder(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "show.zip", "w") as packed:
        packed.writestr(name if not name.endswith("/") else f"{name}a\0/../b", "x")
    inside = tmp_path / "a" / "b"
    inside.mkdir(parents=True)
    with contextlib.suppress(StageError):
        unpack_show(tmp_path / "show.zip", inside)
    found = [one for one in tmp_path.rglob("*") if one.is_file() and not one.is_relative_to(inside / "show")]
    assert found == [tmp_path / "show.zip"]


def test_a_show_that_goes_is_not_interrupted(tmp_path: Path) -> None:
    """The same route, on a box whose show people see: what came counts from the next power-on."""
    with installed(tmp_path / "left") as left:
        pack_show(packed_bundle(tmp_path / "tonight", "tonight"), tmp_path / "show.zip")
        box = {"chosen": str(left.run / CHOSEN)}
        venue = Venue(left.run, box, True, left.data / "state", show_goes=lambda: True)

        async def main() -> str:
            app = web.Application(client_max_size=1)
            app.add_routes(venue.routes())
            async with TestClient(TestServer(app)) as client:
                answer = await client.post("/api/show", data=(tmp_path / "show.zip").read_bytes())
                message: str = (await answer.json())["message"]
                return message

        assert "after the next power-on" in asyncio.run(main())
        kept = Choice.read(left.data / CHOSEN)
        assert kept is not None and kept.first.source == "show from another box"
        assert left.dances == "before" and not (left.run / "anew").exists()
