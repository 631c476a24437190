"""Reports to a technician far away: what is told and when; sent to a real server, by webhook and by mail."""

from __future__ import annotations

import contextlib
import json
import socketserver
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from appliance.console.report import FILE, Reports, report, send, settings_in
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
    told = [reports.look(box(SILENT, uptime_s=4000.0), now) for now in (0.0, 9.0, 10.0, 11.0)]
    assert told == [[], [], ["Fallback: No readings."], []]
    assert reports.look(box(uptime_s=4000.0), 30.0) == [], "a report a minute"
    assert reports.look(box(uptime_s=4000.0), 70.0) == ["Over: No readings."]
    assert reports.look(box(uptime_s=4000.0), 700.0) == []


def test_a_moment_of_silence_is_never_told() -> None:
    reports = Reports(after_s=10.0, every_s=5.0)
    for now in range(0, 100, 10):
        assert reports.look(box(SILENT, uptime_s=4000.0), float(now)) == []
        assert reports.look(box({**SILENT, "active": False}, uptime_s=4000.0), now + 5.0) == []


def test_a_webhook_gets_json() -> None:
    with _web_server() as (port, came):
        send(
            {"webhook": f"http://127.0.0.1:{port}/hook", "mail": None}, report(["Over: A."], box(SILENT), 7.0)
        )
    ((path, told),) = came
    assert path == "/hook" and told["text"].endswith(": Over: A.") and told["time"] == 7.0
    assert told["fallbacks"] == [{"name": "sensor-silent", "about": "left-wrist"}]


def test_a_mail_arrives() -> None:
    with _mail_server() as (port, came):
        mail = {"host": "127.0.0.1", "port": port, "encryption": "none", "user": None, "password": None}
        send(
            {"webhook": None, "mail": mail | {"sender": "box@a.b", "to": ["me@c.d"]}},
            report(["On."], box(), 7.0),
        )
    assert "RCPT TO:<me@c.d>" in [line.upper().replace("ME@C.D", "me@c.d") for line in came]
    assert any(line.endswith(": On.") for line in came)


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
def _web_server() -> Iterator[tuple[int, list[tuple[str, Any]]]]:
    came: list[tuple[str, Any]] = []

    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            came.append((self.path, json.loads(self.rfile.read(int(self.headers["Content-Length"])))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *arguments: object) -> None:
            """Nothing."""

    with _serving(HTTPServer(("127.0.0.1", 0), Hook)) as port:
        yield port, came


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
