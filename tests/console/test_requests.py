"""Requests: looking is open, acting needs the PIN; whatever else comes is refused with a sentence."""

from __future__ import annotations

import contextlib
import gzip
import random
import re
import socket
import time
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from importlib.metadata import version
from pathlib import Path
from urllib.parse import urlparse

import pytest

from appliance.box.roster import RosterLine
from appliance.box.show_state import ShowStateReader
from appliance.console import guard
from appliance.console.body import LARGEST_REQUEST
from appliance.console.box_view import BoxView
from appliance.console.desk import NO_COMMANDS, SILENT, Desk
from appliance.console.devices import FREE_TRIES
from appliance.console.seen_stage import SeenStage
from appliance.console.stage_view import StageView
from appliance.console.verdict import verdict
from appliance.levers.status import Status
from hw_sim.peers import HOST
from tests.console.page import Answer, Page, page_alone
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, until
from tests.system.processes import run_bunraku


def loaded_first(page: Page) -> dict[str, Answer]:
    """What a browser loads to show the page in German: the files that it names, and those they import."""
    found, asked = {"/": page.get("/")}, ["/words/de.json"]
    asked += re.findall(r'(?:href|src)="(/[^"/]+)"', found["/"].text)
    while asked:
        path = asked.pop()
        if path not in found:
            found[path] = page.get(path)
            if path.endswith(".js"):
                asked += re.findall(r'^import\b[^;]*?"\.(/[^"]+)"', found[path].text, re.MULTILINE)
    return found


def test_a_browser_loads_the_page_in_a_hundred_kilobytes(page: Page) -> None:
    """Through a venue's Wi-Fi, with a hundred phones in the house."""
    packed = 0
    for path, answer in loaded_first(page).items():
        request = urllib.request.Request(page.origin + path, headers={"Accept-Encoding": "gzip"})
        with urllib.request.urlopen(request) as sent:
            content = sent.read()
        assert (sent.headers["Content-Encoding"], sent.headers["Vary"]) == ("gzip", "Accept-Encoding"), path
        assert gzip.decompress(content).decode() == answer.text
        assert sent.headers["ETag"] == answer.headers["ETag"]
        packed += len(content)
    assert packed < 110_000


def test_looking_needs_no_pin_and_every_file_is_the_box_s_own(page: Page) -> None:
    files = loaded_first(page)
    assert len(files) > 40, "it follows the imports"
    for path, answer in files.items():
        assert answer.status == 200, path
        assert "http://" not in answer.text.replace("http://www.w3.org/2000/svg", ""), (
            "nothing comes from elsewhere"
        )
        assert "https://" not in answer.text
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        again = page.get(path, If_None_Match=answer.headers["ETag"])
        assert (again.status, again.text) == (304, "")
    assert sum(len(one.text.encode()) for one in files.values()) < 320_000  # the German words are 49 kB of it
    assert page.get("/status").value["verdict"]["key"] == "stage_absent"


def test_acting_needs_the_pin_and_a_remembered_device_needs_it_once(own_page: Page) -> None:
    refused = own_page.command("/panic")
    assert refused.status == 401 and "PIN" in refused.text
    assert own_page.get("/api/devices").status == 401
    wrong = own_page.post("/api/pin", {"pin": f"{(int(own_page.pin) + 1) % 1_000_000:06}", "name": "x"})
    assert wrong.status == 403 and "Set-Cookie" not in wrong.headers
    own_page.unlock()
    assert own_page.get("/api/me").value["known"] is True
    assert own_page.command("/panic").status == 503, "no show control answers here, and it says so"
    (own,) = own_page.get("/api/devices").value
    assert own["own"] and own["name"] == "a test"
    assert own_page.post("/api/revoke", {"id": own["id"]}).status == 200
    assert own_page.command("/panic").status == 401


def test_the_cookie_is_for_the_page_alone(page: Page) -> None:
    answer = page.post("/api/pin", {"pin": page.pin, "name": "phone"})
    assert "HttpOnly" in answer.headers["Set-Cookie"] and "SameSite=Strict" in answer.headers["Set-Cookie"]


def test_devices_are_listed_and_revoked_at_the_prompt(own_page: Page) -> None:
    own_page.unlock()
    listed = run_bunraku("console", "devices", "--box", own_page.box_file).stdout
    assert "a test" in listed
    assert run_bunraku("console", "revoke", listed.split()[0], "--box", own_page.box_file).returncode == 0
    assert own_page.command("/panic").status == 401
    missing = run_bunraku("console", "revoke", "nobody", "--box", own_page.box_file)
    assert missing.returncode == 2 and "no device nobody" in missing.stderr
    before = own_page.pin
    chosen = run_bunraku("console", "pin", "--new", "--box", own_page.box_file).stdout.strip()
    assert chosen == Page(own_page.port, own_page.box_file).pin != before
    assert own_page.post("/api/pin", {"pin": before, "name": ""}).status == 403


def test_wrong_pins_are_slowed_down_and_then_even_the_right_one_waits(own_page: Page) -> None:
    pin = own_page.pin
    for _ in range(FREE_TRIES):
        assert own_page.post("/api/pin", {"pin": "x" * 6, "name": ""}).status == 403
    late = own_page.post("/api/pin", {"pin": pin, "name": ""})
    assert late.status == 429 and 0 < int(late.headers["Retry-After"]) <= 60


def test_pins_that_wait_for_their_bodies_are_counted_like_all_others(own_page: Page) -> None:
    """Requests that are all begun before the first wrong PIN came: five of them are tried."""
    body = b'{"pin": "xxxxxx", "name": ""}'
    head = f"POST /api/pin HTTP/1.1\r\nHost: {HOST}:{own_page.port}\r\nOrigin: {own_page.origin}\r\n"
    head += f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    with contextlib.ExitStack() as opened:
        begun = [
            opened.enter_context(socket.create_connection((HOST, own_page.port), 60))
            for _ in range(4 * FREE_TRIES)
        ]
        for one in begun:
            one.sendall(head.encode() + body[:1])
        own_page.get("/status")
        time.sleep(0.5)
        for one in begun:
            one.sendall(body[1:])
        answers = [one.recv(12)[9:] for one in begun]
    assert answers.count(b"403") == FREE_TRIES and answers.count(b"429") == 3 * FREE_TRIES


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://{host}", "http://{host}.evil.example"]
)
def test_a_forged_origin_is_refused_with_and_without_the_cookie(page: Page, origin: str) -> None:
    page.unlock()
    forged = origin.format(host=f"{HOST}:{page.port}")
    for path, said in (("/api/command", {"address": "/panic"}), ("/api/pin", {"pin": page.pin, "name": ""})):
        answer = page.post(path, said, Origin=forged)
        assert answer.status == 403 and "another page" in answer.text
    assert page.request("POST", "/api/command", b'{"address": "/panic"}', {}).status == 403, "none at all"
    answer = page.get("/watch", Upgrade="websocket", Connection="Upgrade", Origin=forged)
    assert answer.status == 403


def test_a_name_that_is_not_the_box_s_is_refused(page: Page) -> None:
    """A foreign page that points its own name at the box (DNS rebinding) gets nothing."""
    assert page.get("/status", Host="evil.example").status == 403
    assert page.get("/status", Host=f"localhost:{page.port}").status == 200
    assert page.get("/status", Host=f"[::1]:{page.port}").status == 200
    assert page.get("/status", Host=f"{socket.gethostname()}.local").status == 200


def test_no_command_that_the_page_does_not_have(page: Page) -> None:
    page.unlock()
    for address, arguments in (
        ("/status", []),
        ("/nothing", []),
        (5, []),
        ("/cue", [["a"]]),
        ("/cue", "a"),
        ("/cue", [None] * 3),
        ("/cue", ["a"] * 99),
    ):
        assert page.post("/api/command", {"address": address, "arguments": arguments}).status == 400
    for address, arguments in (
        ("/master", [2.0]),
        ("/master", ["a"]),
        ("/cue", ["a" * 101]),
        ("/cue", ["\x07"]),
    ):
        answer = page.post("/api/command", {"address": address, "arguments": arguments})
        assert answer.status == 200 and answer.value["done"] is False and answer.value["message"]


def test_whatever_comes_as_a_body_is_refused(page: Page, rng: random.Random, long_run: bool) -> None:
    page.unlock()
    bodies = [b"", b"[]", b"5", b"null", b"{", b"[" * 3000, b'{"pin": 5}', b"\xff\xfe", b'{"pin": NaN}']
    bodies += [rng.randbytes(rng.randrange(200)) for _ in range(1000 if long_run else 100)]
    for body in bodies:
        for path in ("/api/pin", "/api/command", "/api/revoke"):
            answer = page.post(path, body)
            assert 400 <= answer.status < 500, (path, body)
            if answer.status == 429:
                break
    assert page.post("/api/command", b"x" * (LARGEST_REQUEST + 1)).status == 413
    assert page.get("/status").status == 200


def test_the_box_tells_what_it_is(page: Page) -> None:
    reported = page.get("/api/box").value
    assert reported["box_file"] == str(page.box_file.resolve())
    assert reported["version"] == version("bunraku") and reported["host"] == socket.gethostname()
    assert reported["shows"] == [], "nothing was chosen at power-on here"


def test_a_box_file_that_is_gone_is_no_fault_of_the_page(own_page: Page) -> None:
    own_page.box_file.unlink()
    assert own_page.get("/api/box").status == 200
    assert own_page.get("/status").status == 200


def test_a_box_without_a_journal_says_so(page: Page) -> None:
    for path in (
        "/api/happened",
        "/api/happened/stretch?run=1&from=0",
        "/api/happened/dance.bvh?run=1&from=0",
    ):
        answer = page.get(path)
        assert answer.status == 404 and "keeps no journal" in answer.text


@pytest.mark.parametrize(
    "query",
    [
        "",
        "run=1",
        "run=x&from=0",
        "run=0&from=0",
        "run=1&from=-1",
        "run=1&from=0&seconds=1000",
        "run=1&from=nan",
    ],
)
def test_no_more_of_the_dance_is_read_than_a_stretch(page: Page, query: str) -> None:
    assert page.get(f"/api/happened/stretch?{query}").status == 400
    assert page.get("/api/happened/dance.exe?run=1&from=0").status in (400, 404)
    assert page.get(f"/api/happened/dance.bunraku?{query}").status == 400


def test_a_venue_may_hide_the_rehearsal(tmp_path: Path) -> None:
    with page_alone(tmp_path, rehearsal=False) as (page, _):
        assert page.get("/api/me").value["rehearsal"] is False


def test_whatever_changes_something_needs_the_pin(own_page: Page) -> None:
    """All routes in the sources: one that is added without a thought for that is closed."""
    sources = "".join(path.read_text() for path in Path(guard.__file__).parent.glob("*.py"))
    routes = set(re.findall(r'web\.post\("(/[^"{]+)"', sources))
    assert len(routes) > 25
    open_ones = {path for path in routes if own_page.post(path, {}).status != 401}
    assert open_ones == {"/api/pin", *(f"/api/phones/{act}" for act in ("join", "reading", "leave"))}
    for path in ("/hands", "/api/box/file", "/api/learn", "/api/logs", "/api/update"):
        assert own_page.get(path).status == 401, path


def test_no_path_leads_out_of_the_page(page: Page) -> None:
    for path in (
        "/../server.py",
        "/..%2fserver.py",
        "/%2e%2e/server.py",
        "//etc/passwd",
        "/words/../../run.py",
        "/nothing",
    ):
        assert page.get(path).status == 404, path
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH"):
        assert page.request(method, "/status", b"", {"Origin": page.origin}).status in (404, 405)


def test_the_raw_port_survives_what_is_no_http(page: Page, rng: random.Random, long_run: bool) -> None:
    starts = [
        b"GET / HTTP/1.1\r\nHost: a\r\n",
        b"GET /watch HTTP/1.1\r\n",
        b"POST /api/pin HTTP/1.1\r\n",
        b"",
    ]
    for _ in range(1000 if long_run else 100):
        with socket.create_connection((HOST, page.port), 60) as one:
            one.sendall(rng.choice(starts) + rng.randbytes(rng.randrange(400)))
    assert page.get("/status").status == 200


def test_a_page_for_a_network_refuses_others(tmp_path: Path) -> None:
    """The test's own way to it is by loopback, which always may look; the guard is asked about the rest."""
    with page_alone(tmp_path, host="::", viewers=["192.168.0.0/24", "fd00::/8"]) as (page, _):
        assert page.is_open(), "IPv4 comes in by the same socket"
        host = urlparse(page.origin).port
        with socket.create_connection(("::1", host), 60) if socket.has_ipv6 else socket.socket() as one:
            one.sendall(f"GET /status HTTP/1.1\r\nHost: [::1]:{host}\r\nConnection: close\r\n\r\n".encode())
            assert one.recv(100).startswith(b"HTTP/1.1 200")
    network = guard.Guard(["192.168.0.0/24", "fd00::/8"], [], None, None)  # type: ignore[arg-type]
    for address, may in (
        ("127.0.0.1", True),
        ("::1", True),
        ("192.168.0.9", True),
        ("fd00::5", True),
        ("192.168.1.9", False),
        ("2001:db8::1", False),
        ("", False),
    ):
        assert network._may_look(address) is may, address


LINE = RosterLine(
    "left-wrist", "0000002a", "linked", "udp", 50.0, 0.01, 0.002, 0.01, 80, 255, 0, "1", "imu", "", ""
)


@pytest.fixture
def view(tmp_path: Path) -> Iterator[BoxView]:
    stage = StageView(tmp_path)
    seen = SeenStage(tmp_path, stage)
    yield BoxView(Desk(("127.0.0.1", 9)), stage, seen, ShowStateReader(tmp_path))
    seen.close()
    stage.close()


def test_the_page_tells_what_a_desk_is_answered(tmp_path: Path, view: BoxView) -> None:
    control = ControlInThread(tmp_path)
    with StageDouble(tmp_path) as stage, closing(Asker(control.port)) as asker:
        stage.hold("lShldr")
        stage.tell(phrase="quiet", let_go=["lShldr"], coding=8, seed=7, liveliness=0.25, sensors=[LINE])
        until(lambda: asker.ask("/cue", "storm")[2] == 1)
        asker.ask("/look", "plastr")  # refused
        asker.ask("/master", 0.5, 30.0)
        refused = control.process.handler.refused

        def is_told() -> bool:
            """Show control publishes once a second."""
            view.refresh()
            return view.value["status"] is not None and view.value["status"]["refused"] == refused

        until(is_told)
        reported = view.value
        answered = asker.status()._asdict()
        for changing in ("level", "uptime_s"):
            answered.pop(changing), reported["status"].pop(changing)
        assert reported["status"] == {name: pytest.approx(value) for name, value in answered.items()}
        for question in ("cues", "phrases", "looks", "cards"):
            *answers, _ = asker.ask_all(f"/{question}")
            assert [[one["name"], int(one["now"])] for one in reported[question]] == [
                one[1:] for one in answers
            ]
        assert reported["hands"] == [
            {"joint": "lShldr", "source": "left-wrist", "holds": False, "by": "orientation", "is_held": True}
        ]
        (sensor,) = reported["sensors"]
        assert (sensor["name"], sensor["battery"], sensor["heard"]) == ("left-wrist", 80, True)
        assert (reported["frames"], reported["trouble"]) == ("fresh", "")
        began, seconds = reported["fade"]
        assert (reported["time"] - reported["cue_since"], seconds) == pytest.approx((0.0, 30.0), abs=5.0)
        assert reported["cue_since"] <= began <= reported["time"]
    control.close()


def test_a_clock_that_is_set_back_keeps_no_warning(
    tmp_path: Path, view: BoxView, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine whose clock had the time of its country, until a network told it."""
    status = Status(state="dancing", rate_hz=50.0, level=1.0, late=2, uptime_s=600.0)
    began = time.monotonic()
    view._note_late(status, began)
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() - 7200.0)
    view._note_late(status._replace(uptime_s=601.0), began + 1.0)
    told = view._value(began + 61.0)["since"]
    assert real() - 7200.0 - told == pytest.approx(61.0, abs=5.0)
    assert verdict("fresh", status, [], [], told, "").key == "well_alone"
    monkeypatch.setattr(time, "time", lambda: real() + 7200.0)
    view._note_late(status._replace(uptime_s=662.0), began + 62.0)
    assert verdict("fresh", status, [], [], view._value(began + 62.0)["since"], "").key == "well_alone"


def test_a_page_that_starts_again_does_not_date_late_ticks_that_it_has_not_seen(
    tmp_path: Path, view: BoxView
) -> None:
    """The journal has their time; the page says only that none came after its own start."""
    control = ControlInThread(tmp_path)
    until(lambda: (view.refresh(), view.value["status"])[1] is not None)
    status = Status(state="dancing", rate_hz=50.0, level=1.0, late=2, uptime_s=600.0)
    began = time.monotonic()
    fresh = BoxView(view._desk, view._stage, view._seen, view._show_state)
    fresh._note_late(status, began)
    assert not fresh._saw_late
    fresh._note_late(status._replace(late=3, uptime_s=601.0), began + 1.0)
    assert fresh._saw_late
    for saw_late, key in ((False, "well_alone"), (True, "late")):
        assert verdict("fresh", status, [], [], time.time(), "", saw_late).key == key
    control.close()


def test_without_show_control_the_page_says_so(tmp_path: Path, view: BoxView) -> None:
    view.refresh()
    assert (view.value["trouble"], view.value["status"], view.value["hands"]) == (SILENT, None, [])
    control = ControlInThread(tmp_path)
    until(lambda: (view.refresh(), view.value["status"])[1] is not None)
    control.close()
    view.refresh()
    assert view.value["trouble"] == SILENT
    stage = StageView(tmp_path)
    none = BoxView(Desk(None), stage, SeenStage(tmp_path, stage), ShowStateReader(tmp_path))
    none.refresh()
    assert none.value["trouble"] == NO_COMMANDS and not none.value["control"]
