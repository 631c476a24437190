"""The box's name in the network: what avahi is told, what it answers, and which names are the box's own."""

from __future__ import annotations

import socket
import threading
import xml.etree.ElementTree as Xml
from contextlib import closing
from pathlib import Path

import pytest

from appliance.box import served
from appliance.box.served import OwnNames, name_in_network
from appliance.cli.announce import TYPE, announce, main
from appliance.release.choice import Choice, ShowAndBox
from appliance.show.box import BoxConfig, load_box


def box(folder: Path, console: str) -> BoxConfig:
    path = folder / "box.yaml"
    path.write_text(f"console: {console}\n")
    return load_box(path)


@pytest.mark.parametrize(("https", "scheme"), [("false", "http"), ("true", "https")])
def test_the_page_is_announced_for_browsers_and_for_lists_of_boxes(
    tmp_path: Path, https: str, scheme: str
) -> None:
    asked = f"{{host: '::', port: 8443, https: {https}, viewers: [10.0.0.0/8]}}"
    announce(box(tmp_path, asked), tmp_path / "told")
    group = Xml.fromstring((tmp_path / "told").read_text())
    found = {one.findtext("type"): one.findtext("port") for one in group.iter("service")}
    assert found == {TYPE: "8443", f"_{scheme}._tcp": "8443"}
    assert group.findtext("name") == "Bunraku on %h"
    assert f"scheme={scheme}" in [one.text for one in group.iter("txt-record")]
    assert (tmp_path / "told").stat().st_mode & 0o777 == 0o644, "avahi is another user"


@pytest.mark.parametrize("console", ["null", "{port: 8080}", "{host: '::', port: 0, viewers: [10.0.0.0/8]}"])
def test_a_page_that_nobody_else_can_open_is_not_announced(tmp_path: Path, console: str) -> None:
    (tmp_path / "told").write_text("of the box file before")
    announce(box(tmp_path, console), tmp_path / "told")
    assert not (tmp_path / "told").exists()


def test_the_unit_announces_what_was_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    box(tmp_path, "{host: '::', port: 8081, viewers: [10.0.0.0/8]}")
    Choice((ShowAndBox(box=tmp_path / "box.yaml"),)).write(tmp_path / "chosen.json")
    monkeypatch.setattr(announce, "__defaults__", (tmp_path / "told",))
    main(["--chosen", str(tmp_path / "chosen.json")])
    assert "<port>8081</port>" in (tmp_path / "told").read_text()


@pytest.mark.parametrize(
    ("answer", "name"),
    [(b"+ 3 0 bunraku-2.local\n", "bunraku-2.local"), (b"-15 Timeout reached\n", ""), (b"", "")],
)
def test_avahi_is_asked_for_the_name_that_it_gave(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes, name: str
) -> None:
    monkeypatch.setattr(served, "_AVAHI", tmp_path / "socket")
    assert name_in_network() == "", "no avahi"
    with closing(socket.socket(socket.AF_UNIX)) as avahi:
        avahi.bind(str(tmp_path / "socket"))
        avahi.listen()
        asked: list[bytes] = []

        def answering() -> None:
            with closing(avahi.accept()[0]) as asker:
                asked.append(asker.recv(1024))
                asker.sendall(answer)

        thread = threading.Thread(target=answering)
        thread.start()
        assert name_in_network() == name
        thread.join()
    assert asked[0].startswith(b"RESOLVE-ADDRESS ") and asked[0].endswith(b"\n")


def test_the_page_answers_to_the_name_that_another_box_has_left_it() -> None:
    own, names = socket.gethostname(), OwnNames(["show.example"])
    for host in (own, f"{own}.local", f"{own}-2.local:8080", "show.example", "localhost"):
        assert names.has(host), host
    for host in (f"{own}-x.local", f"{own}-2.example", f"x{own}.local"):
        assert not names.has(host), host
