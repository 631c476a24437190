"""Reports to a technician far away: what is told and when; sent to a real server, by webhook and by mail."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socketserver
import threading
import time
from collections.abc import Iterator, Mapping
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

import appliance.console.report
from appliance.box.fallback import Fallbacks
from appliance.console.fallback import OF_THE_PAGE
from appliance.console.report import FILE, Post, Reports, posts_of, settings_in, watch
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError

SILENT = {"name": "sensor-silent", "about": "left-wrist", "message": "No readings.", "active": True}


def box(*fallbacks: dict[str, Any], uptime_s: float = 5.0) -> dict[str, Any]:
    return {"frames": "fresh", "status": {"uptime_s": uptime_s, "show": "A"}, "fallbacks": list(fallbacks)}


def test_a_box_that_comes_on_is_told_once_and_a_restarted_page_is_not() -> None:
    reports = Reports(after_s=10.0, every_s=60.0)
    assert reports.look({"frames": "absent", "status": None}, 0.0) == []
    assert reports.look(box(), 1.0) == ["The box is on. Show: A."]
    assert reports.look(box(), 100.0) == []
    assert Reports(after_s=10.0, every_s=60.0).look(box(uptime_s=4000.0), 1.0) == []


def test_a_fallback_is_told_when_it_lasts_and_when_it_is_over() -> None:
    reports = Reports(after_s=10.0, every_s=60.0)
    reported = [reports.look(box(SILENT, uptime_s=4000.0), now) for now in (0.0, 9.0, 10.0, 11.0)]
    assert reported == [[], [], ["Fallback: No readings."], []]
    assert reports.look(box(uptime_s=4000.0), 30.0) == [], "a report a minute"
    assert reports.look(box(uptime_s=4000.0), 70.0) == ["Over: No readings."]
    assert reports.look(box(uptime_s=4000.0), 700.0) == []


def test_a_moment_of_silence_is_never_told() -> None:
    reports = Reports(after_s=10.0, every_s=5.0)
    for now in range(0, 100, 10):
        assert reports.look(box(SILENT, uptime_s=4000.0), float(now)) == []
        assert reports.look(box({**SILENT, "active": False}, uptime_s=4000.0), now + 5.0) == []


def test_a_clock_that_is_set_reports_nothing_early_and_holds_no_report_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    came: list[str] = []
    module = appliance.console.report
    monkeypatch.setattr(module, "_LOOK_S", 0.01)
    monkeypatch.setattr(module, "posts_of", lambda _: [Post("mail", lambda one: came.append(one["text"]))])
    real, step = time.time, 0.0
    monkeypatch.setattr(time, "time", lambda: real() + step)
    fallbacks = [SILENT]

    def value() -> dict[str, Any]:
        return box(*fallbacks, uptime_s=4000.0)

    async def watched() -> None:
        nonlocal step
        watching = asyncio.create_task(watch({"after_s": 1.0, "every_s": 0.0}, value, Fallbacks(OF_THE_PAGE)))
        await asyncio.sleep(0.1)
        step = 86400.0
        await asyncio.sleep(0.3)
        assert not came, "it has not lasted for a second yet"
        step = -86400.0
        await asyncio.sleep(1.5)
        assert len(came) == 1 and "No readings" in came[0]
        fallbacks.clear()
        await asyncio.sleep(0.5)
        assert len(came) == 2 and "Over" in came[1]
        watching.cancel()

    asyncio.run(watched())


def sent(settings: dict[str, Any], lines: list[str], value: dict[str, Any]) -> None:
    """One report by each way."""

    async def posted() -> None:
        for post in posts_of(settings):
            post.add(lines)
            await post.look(value, 0.0)
            assert post.trouble == ""

    asyncio.run(posted())


def test_a_webhook_gets_json() -> None:
    with _web_server() as (port, came, _):
        sent({"webhook": f"http://127.0.0.1:{port}/hook", "mail": None}, ["Over: A."], box(SILENT))
    ((path, reported),) = came
    assert path == "/hook" and reported["text"].endswith(": Over: A.")
    assert reported["fallbacks"] == [{"name": "sensor-silent", "about": "left-wrist"}]


def test_a_mail_arrives() -> None:
    with _mail_server() as (port, came):
        mail = {"host": "127.0.0.1", "port": port, "encryption": "none", "user": None, "password": None}
        sent({"webhook": None, "mail": mail | {"sender": "box@a.b", "to": ["me@c.d"]}}, ["On."], box())
    assert "RCPT TO:<me@c.d>" in [line.upper().replace("ME@C.D", "me@c.d") for line in came]
    assert any(line.endswith(": On.") for line in came)


def test_a_report_that_is_refused_is_a_fallback_until_it_arrives(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A real server answers 503 to the first two, then takes one with all that was to be told meanwhile."""
    monkeypatch.setattr(appliance.console.report, "_LOOK_S", 0.01)
    monkeypatch.setattr(appliance.console.report, "_RETRY_S", 0.02)
    fallbacks, value, seen = Fallbacks(OF_THE_PAGE), box(), []

    def unsent() -> list[tuple[str, bool]]:
        return [(one.about, one.active) for one in fallbacks.happened(0.0) if one.name == "report-unsent"]

    async def watched(port: int, came: list[Any], refusals: list[int]) -> None:
        settings = {"webhook": f"http://127.0.0.1:{port}/hook", "mail": None, "after_s": 0.0, "every_s": 0.0}
        task = asyncio.create_task(watch(settings, lambda: value, fallbacks))
        while unsent() != [("webhook", True)]:
            await asyncio.sleep(0.001)
        value["fallbacks"] = [SILENT, {**SILENT, "name": "report-unsent", "about": "webhook"}]
        seen.append(len(came))
        refusals.append(0)
        while unsent() != [("webhook", False)]:
            await asyncio.sleep(0.001)
        task.cancel()

    with _web_server(refuses=True) as (port, came, refusals):
        asyncio.run(asyncio.wait_for(watched(port, came, refusals), 60.0))
    texts = [reported["text"] for _, reported in came]
    assert seen == [0] and any("The box is on" in text for text in texts)
    assert "tried again" not in "".join(texts), "a report about itself"
    assert capfd.readouterr().out.count("could not be sent (HTTP Error 503") == 1


def test_tries_come_ever_later_and_what_waits_is_bounded() -> None:
    tries: list[int] = []

    def refused(reported: Mapping[str, Any]) -> None:
        tries.append(len(reported["text"]))
        raise OSError("no route")

    async def look() -> list[float]:
        post, at = Post("mail", refused), []
        for second in range(3000):
            post.add([f"Fallback: {second}."] if second < 500 else [])
            await post.look(box(), float(second))
            at += [float(second)] * (len(tries) - len(at))
        assert post.trouble == "no route"
        return at

    at = asyncio.run(look())
    assert at[:7] == [0.0, 5.0, 15.0, 35.0, 75.0, 155.0, 315.0] and at[-1] - at[-2] == 300.0
    assert abs(tries[-1] - tries[-2]) <= 1  # the number that were left out
    assert tries[-1] < 40 * 20 + 200


def test_nothing_is_sent_unless_the_box_file_asks_for_it(tmp_path: Path) -> None:
    assert load_box(None).console.report is None  # type: ignore[union-attr]
    assert settings_in(tmp_path) is None
    (tmp_path / FILE).write_text("spoilt")
    assert settings_in(tmp_path) is None


@pytest.mark.parametrize(
    ("report_keys", "message"),
    [
        ("{}", "goes nowhere"),
        ("{webhook: example.org}", "is no web address"),
        ("{mail: {to: [me], sender: a@b.c, host: m}}", "is no mail address"),
        ("{mail: {to: [a@b.c], sender: a@b.c, host: m, user: me}}", "belong together"),
    ],
)
def test_a_report_that_could_not_arrive_is_refused(tmp_path: Path, report_keys: str, message: str) -> None:
    (tmp_path / "box.yaml").write_text(f"console: {{report: {report_keys}}}\n")
    with pytest.raises(ConfigError, match=message):
        load_box(tmp_path / "box.yaml")


@contextlib.contextmanager
def _web_server(refuses: bool = False) -> Iterator[tuple[int, list[tuple[str, Any]], list[int]]]:
    """Its port, what came, and a list: it answers 503 until something is in it, if it refuses."""
    came: list[tuple[str, Any]] = []
    accepts = [] if refuses else [1]

    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            reported = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            if accepts:
                came.append((self.path, reported))
            self.send_response(200 if accepts else 503)
            self.end_headers()

        def log_message(self, *arguments: object) -> None:
            """Nothing."""

    with _serving(HTTPServer(("127.0.0.1", 0), Hook)) as port:
        yield port, came, accepts


@contextlib.contextmanager
def _mail_server() -> Iterator[tuple[int, list[str]]]:
    """As much SMTP as a letter needs (RFC 5321)."""
    came: list[str] = []

    class Letter(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(b"220 test\r\n")
            is_letter = False
            for line in self.rfile:
                came.append(line.decode().rstrip())
                if is_letter and came[-1] != ".":
                    continue
                is_letter = came[-1].upper() == "DATA"
                answer = {"DATA": b"354 go on\r\n", "QUIT": b"221 bye\r\n"}
                self.wfile.write(answer.get(came[-1].upper(), b"250 ok\r\n"))
                if came[-1].upper() == "QUIT":
                    return

    with _serving(socketserver.TCPServer(("127.0.0.1", 0), Letter)) as port:
        yield port, came


@contextlib.contextmanager
def _serving(server: socketserver.TCPServer) -> Iterator[int]:
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
