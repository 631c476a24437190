"""What the page changes counts at once, and all that reads and writes it may do so in the page's sandbox."""

from __future__ import annotations

import ssl
import time
from typing import Any

import pytest

from tests.boot.box import Box
from tests.boot.device import BUNRAKU, Device

pytestmark = pytest.mark.boot


def test_a_changed_box_file_counts_at_once_and_the_one_before_comes_back(
    dancing: Box, device: Device
) -> None:
    box, machine = dancing, dancing.machine
    machine.await_that(box.is_proven, "the venue's box file does not dance")
    status, reported = device.ask("/api/box/file")
    assert status == 200 and "[" not in reported["file"] and reported["keys"], reported
    location = ["console", "rehearsal"]
    status, answer = device.ask(
        "/api/box/file", {"text": reported["text"], "values": [[["control", "port"], "x"]], "now": True}
    )
    assert (
        status == 200 and "control.port" in answer["problems"][0]["message"] and answer["problems"][0]["line"]
    )
    before = device.ask("/api/box")[1]["shows"][0]["id"]
    change = {"text": reported["text"], "values": [[location, False]], "now": True}
    changed = time.time()
    status, answer = device.ask("/api/box/file", change)
    assert (status, answer.get("problems")) == (200, []), answer
    device.await_that(lambda: _rehearses(device) is False, "the change does not count")
    box.await_frames(after=changed + 1.0)
    shows = device.ask("/api/box")[1]["shows"]
    assert shows[0]["source"] == "box file from the page" and before in [one["id"] for one in shows[1:]]
    status, answer = device.ask("/api/box/show", {"id": before})
    assert status == 200, answer
    device.await_that(lambda: _rehearses(device) is True, "what danced before does not come back")
    assert device.ask("/api/box")[1]["shows"][0]["id"] == before


def test_a_kept_cue_is_in_the_show_that_the_box_dances(dancing: Box, device: Device) -> None:
    """What reads the show, its map and its copy runs in the page's own sandbox, too."""
    device.await_that(lambda: device.ask("/api/me")[1]["rehearsal"], "no rehearsal")
    assert device.ask("/api/map")[0] in (200, 404), "404: a show without a map, in its own words"
    answers: list[tuple[int, Any]] = []

    def knows_the_settings() -> bool:
        answers.append(device.ask("/api/cue", {"name": "found"}))
        return answers[-1][0] != 409

    device.await_that(knows_the_settings, "the page knows no settings of the stage")
    status, message = answers[-1]
    assert status == 200, message
    status, answer = device.ask("/api/cue/dance", {})
    assert (status, answer.get("problems")) == (200, []), answer
    device.await_that(lambda: "found" in _cues(device), "the new cue is not in the show")
    assert device.ask("/api/box")[1]["shows"][0]["source"] == "show from the rehearsal"


def _cues(device: Device) -> list[str]:
    status, value = device.ask("/status")
    return [one["name"] for one in value.get("cues", ())] if status == 200 else []


def test_https_makes_its_certificate_in_the_page_s_sandbox(dancing: Box, device: Device) -> None:
    """The last test here: from then on the page answers to HTTPS alone."""
    machine = dancing.machine
    text = device.ask("/api/box/file")[1]["text"]
    change = {"text": text, "values": [[["console", "https"], True]], "now": True}
    status, answer = device.ask("/api/box/file", change)
    assert (status, answer.get("problems")) == (200, []), answer
    device.await_that(lambda: "BEGIN CERT" in _certificate(dancing), "no HTTPS")
    assert "Certificate, SHA-256: " in machine.run(BUNRAKU, "console", "pin")


def _certificate(box: Box) -> str:
    """The certificate of the page's port, as PEM; empty while the page does not answer to HTTPS."""
    try:
        with box.hall.box_network.entered():
            return ssl.get_server_certificate(("127.0.0.1", 8080), timeout=10.0)
    except OSError:
        return ""


def _rehearses(device: Device) -> bool | None:
    status, me = device.ask("/api/me")
    return me["rehearsal"] if status == 200 else None
