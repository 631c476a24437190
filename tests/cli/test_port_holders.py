"""Which process has a port, and whether it is the box's, also while it opens and closes files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from appliance.cli.doctor.host_view import HostView
from appliance.cli.doctor.venue import ports
from appliance.show.box import BoxConfig

ROW = "0: 0100007F:{port:04X} 00000000:0000 07 00000000:00000000 00:00000000 00000000 0 0 77 2"


def test_a_file_closed_during_the_search_hides_no_process(tmp_path: Path) -> None:
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
    assert finding.message.endswith("the box listens."), finding


# Binds a port, says which, and waits until its standard input is closed.
LISTENS = """import socket, sys
port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
port.bind(("127.0.0.1", 0))
print(port.getsockname()[1], flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize(
    ("program", "command", "is_ours"),
    [
        ("my box/bin/bunraku", ("my box/bin/bunraku", "play"), True),
        ("my box/bin/bunraku", ("-I", "-X", "utf8", "my box/bin/bunraku", "play"), True),
        ("appliance/stage.py", ("-m", "appliance.stage"), True),
        ("bunraku/listen.py", ("bunraku/listen.py", "--beside", "bunraku"), False),
        ("my bunraku/appliance.py", ("my bunraku/appliance.py", "-m", "appliance.stage"), False),
        ("appliances/listen.py", ("-m", "appliances.listen"), False),
    ],
)
def test_the_box_is_known_by_what_runs_and_not_by_where_it_lies(
    tmp_path: Path, program: str, command: tuple[str, ...], is_ours: bool
) -> None:
    file = tmp_path / program
    file.parent.mkdir(parents=True)
    (file.parent / "__init__.py").touch()  # a package of this name, before any that is installed
    file.write_text(LISTENS)
    here = [word if word != program else str(file) for word in command]
    with subprocess.Popen(
        [sys.executable, *here],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": ""},
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        port = int(process.stdout.readline())
        box = BoxConfig.model_validate({"sensors": {"udp": {"port": port}}, "control": None})
        found = next(iter(ports(HostView(box=box))))
        process.stdin.close()
    assert found.verdict == ("ok" if is_ours else "wrong"), found
