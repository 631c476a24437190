"""Who has a port: told also while that program opens and closes files."""

from __future__ import annotations

from pathlib import Path

from appliance.cli.doctor.host_view import HostView
from appliance.cli.doctor.venue import ports
from appliance.show.box import BoxConfig

ROW = "0: 0100007F:{port:04X} 00000000:0000 07 00000000:00000000 00:00000000 00000000 0 0 77 2"


def test_a_file_that_is_closed_meanwhile_hides_no_process(tmp_path: Path) -> None:
    box = BoxConfig.model_validate({"sensors": {"udp": None}, "control": {"port": 9002}})
    process = tmp_path / "proc/4711"
    for folder in (tmp_path / "proc/net", process / "fd"):
        folder.mkdir(parents=True)
    (tmp_path / "proc/net/udp").write_text(ROW.format(port=9002))
    (process / "cmdline").write_text("python\0-m\0appliance.cli\0play\0")
    (process / "comm").write_text("bunraku")
    (process / "fd/3").symlink_to("socket:[77]")
    for number in (2, 4):
        (process / f"fd/{number}").touch()  # no link, so that it cannot be read as one
    (finding, *_) = ports(HostView(tmp_path, box))
    assert finding.words.endswith("the box listens."), finding
