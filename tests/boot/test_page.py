"""The page on an installed box: what it starts has the rights that it needs under systemd, and no more."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest

from tests.boot.box import STAGE, Box

pytestmark = pytest.mark.boot

BUNRAKU = "/opt/bunraku/current/bin/bunraku"
PROVE = "bunraku-prove"
MEASURED_WITHIN_S = 240.0  # six seconds, and five starts of a box
# Inside the box, as a browser there: a path, what is sent, a cookie; gives status, text, the cookie set.
ASK = """
import json, sys, urllib.error, urllib.request
path, said, cookie = json.loads(sys.argv[1])
origin = "http://127.0.0.1:8080"
body = None if said is None else json.dumps(said).encode()
request = urllib.request.Request(origin + path, body, {"Origin": origin, "Cookie": cookie})
try:
    answer = urllib.request.urlopen(request, timeout=120)
except urllib.error.HTTPError as error:
    answer = error
except OSError as error:
    print(json.dumps([0, str(error), ""]))
    sys.exit()
print(json.dumps([answer.status, answer.read().decode(), answer.headers.get("Set-Cookie", "")]))
"""


class Device:
    """A browser that gave the PIN."""

    def __init__(self, box: Box) -> None:
        self._box, self._cookie = box, ""
        box.await_unit("bunraku-console")
        pin = box.machine.run(BUNRAKU, "console", "pin").strip()
        box.machine.await_that(lambda: self._unlocked(pin), "the page takes no PIN")

    def ask(self, path: str, said: Any = None) -> tuple[int, Any]:
        """Status and value; a text where it is no JSON."""
        status, text, cookie = json.loads(
            self._box.machine.run(
                *("/opt/bunraku/current/bin/python", "-c", ASK, json.dumps([path, said, self._cookie])),
                patience_s=130.0,
            )
        )
        self._cookie = cookie.partition(";")[0] or self._cookie
        try:
            return status, json.loads(text)
        except ValueError:
            return status, text

    def proven(self, kind: str) -> dict[str, Any]:
        """What is kept once it is proven."""
        machine = self._box.machine
        machine.await_that(
            lambda: self.ask("/api/prove")[1]["runs"] is None, "the proof has no end", MEASURED_WITHIN_S
        )
        status, newest = self.ask("/api/prove")
        told = machine.run("cat", "/run/bunraku/prove/progress")
        assert status == 200 and newest["proofs"] and newest["proofs"][0]["kind"] == kind, (
            f"{told}\n{machine.log(PROVE)}"
        )
        document: dict[str, Any] = self.ask(f"/api/prove/{newest['proofs'][0]['id']}")[1]
        return document

    def _unlocked(self, pin: str) -> bool:
        return self.ask("/api/pin", {"pin": pin, "name": "a test"})[0] == 200


def test_it_reads_logs_journal_and_box_in_its_own_sandbox(dancing: Box) -> None:
    device = Device(dancing)
    status, lines = device.ask("/api/logs")
    assert status == 200, lines
    assert {"bunraku-stage", "bunraku-console"} <= {line["unit"] for line in lines}
    status, box = device.ask("/api/box")
    assert status == 200 and box["release"] and box["shows"], box
    status, runs = device.ask("/api/happened")
    assert status == 200, runs


def test_latency_is_measured_with_the_rights_of_a_stage(dancing: Box) -> None:
    device, machine = Device(dancing), dancing.machine
    wanted = {"kind": "latency", "seconds": 6}
    assert device.ask("/api/prove", wanted)[0] == 409, "beside a dance that people see"
    assert device.ask("/api/command", {"address": "/stop"})[1]["done"]
    machine.await_that(lambda: not device.ask("/api/prove")[1]["show_goes"], "the show does not stop")
    try:
        status, said = device.ask("/api/prove", wanted)
        assert status == 200, said
        rights = [machine.show(PROVE, key) for key in ("RestrictRealtime", "LimitRTPRIO", "LimitMEMLOCK")]
        assert rights == ["no", "70", "infinity"]
        granted, measured = machine.await_that(lambda: _play(dancing), "no box is measured")
        if granted:  # a machine may refuse the limit to all containers; the unit's own rights are seen above
            assert measured == _policy(dancing, machine.show(STAGE, "MainPID"))
        document = device.proven("latency")
    finally:
        device.ask("/api/command", {"address": "/go"})
    assert document["figures"]["ticks"] > 100 and document["software"]["bunraku"]
    assert {limit["words"] for limit in document["limits"]} >= {"transport, median", "late ticks"}
    machine.await_that(lambda: machine.show(PROVE, "ActiveState") == "inactive", "it does not end")
    assert not machine.run("find", "/run/bunraku/prove", "-name", "wanted").strip()


def test_the_doctor_sees_the_box_from_its_unit(dancing: Box) -> None:
    device = Device(dancing)
    assert device.ask("/api/prove", {"kind": "doctor"})[0] == 200
    found = {one["what"]: one for one in device.proven("doctor")["findings"]}
    assert "Hz" in found["stage"]["words"]
    assert found[f"{STAGE}.service"]["verdict"] != "wrong"


def test_a_changed_box_file_counts_at_once_and_the_one_before_comes_back(dancing: Box) -> None:
    box, device, machine = dancing, Device(dancing), dancing.machine
    machine.await_that(box.is_proven, "the venue's box file does not dance")
    status, told = device.ask("/api/box/file")
    assert status == 200 and "[" not in told["file"] and told["keys"], told
    location = ["console", "rehearsal"]
    status, answer = device.ask(
        "/api/box/file", {"text": told["text"], "values": [[["control", "port"], "x"]], "now": True}
    )
    assert (
        status == 200 and "control.port" in answer["problems"][0]["words"] and answer["problems"][0]["line"]
    )
    before = device.ask("/api/box")[1]["shows"][0]["id"]
    change = {"text": told["text"], "values": [[location, False]], "now": True}
    changed = time.time()
    status, answer = device.ask("/api/box/file", change)
    assert (status, answer.get("problems")) == (200, []), answer
    machine.await_that(lambda: _rehearses(device) is False, "the change does not count")
    box.await_frames(after=changed + 1.0)
    shows = device.ask("/api/box")[1]["shows"]
    assert shows[0]["source"] == "box file from the page" and before in [one["id"] for one in shows[1:]]
    status, answer = device.ask("/api/box/show", {"id": before})
    assert status == 200, answer
    machine.await_that(lambda: _rehearses(device) is True, "what danced before does not come back")
    assert device.ask("/api/box")[1]["shows"][0]["id"] == before


def test_a_kept_cue_is_in_the_show_that_the_box_dances(dancing: Box) -> None:
    """What reads the show, its map and its copy runs in the page's own sandbox, too."""
    device, machine = Device(dancing), dancing.machine
    machine.await_that(lambda: device.ask("/api/me")[1]["rehearsal"], "no rehearsal")
    assert device.ask("/api/map")[0] in (200, 404), "404: a show without a map, in its own words"
    status, words = device.ask("/api/cue", {"name": "found"})
    assert status == 200, words
    status, answer = device.ask("/api/cue/dance", {})
    assert (status, answer.get("problems")) == (200, []), answer
    machine.await_that(lambda: "found" in _cues(device), "the new cue is not in the show")
    assert device.ask("/api/box")[1]["shows"][0]["source"] == "show from the rehearsal"


def _cues(device: Device) -> list[str]:
    status, value = device.ask("/status")
    return [one["name"] for one in value.get("cues", ())] if status == 200 else []


def test_https_makes_its_certificate_in_the_page_s_sandbox(dancing: Box) -> None:
    """The last test here: from then on the page answers to HTTPS alone."""
    device, machine = Device(dancing), dancing.machine
    text = device.ask("/api/box/file")[1]["text"]
    change = {"text": text, "values": [[["console", "https"], True]], "now": True}
    status, answer = device.ask("/api/box/file", change)
    assert (status, answer.get("problems")) == (200, []), answer
    served = "import ssl; print(ssl.get_server_certificate(('127.0.0.1', 8080)))"
    python = "/opt/bunraku/current/bin/python"
    machine.await_that(lambda: "BEGIN CERT" in machine.run(python, "-c", served, check=False), "no HTTPS")
    assert "Certificate, SHA-256: " in machine.run(BUNRAKU, "console", "pin")


def _rehearses(device: Device) -> bool | None:
    status, me = device.ask("/api/me")
    return me["rehearsal"] if status == 200 else None


def _play(box: Box) -> tuple[bool, str] | None:
    """Whether the box that is measured may ask for real time, and its scheduling; None before it dances."""
    procs = f"/sys/fs/cgroup/system.slice/{PROVE}.service/cgroup.procs"
    for pid in box.machine.run("cat", procs, check=False).split():
        words = box.machine.run("cat", f"/proc/{pid}/cmdline", check=False).split("\0")
        if "play" in words and "at_s" in box.machine.run("cat", "/run/bunraku/prove/progress"):
            limits = box.machine.run("cat", f"/proc/{pid}/limits", check=False).splitlines()
            granted = any(line.split()[:4] == ["Max", "realtime", "priority", "70"] for line in limits)
            return granted, _policy(box, pid)
    return None


def _policy(box: Box, pid: str) -> str:
    """proc(5): the policy and the priority of a process's main thread."""
    fields = box.machine.run("cat", f"/proc/{pid}/stat", check=False).rpartition(")")[2].split()
    return " ".join((fields[38], fields[37])) if fields else ""
