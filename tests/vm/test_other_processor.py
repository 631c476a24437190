"""The box on a Raspberry Pi's processor, emulated: it dances, and dances a PC's journal again.

One program at a time in the image's own root, without a kernel of its own. onnxruntime reads its processor
from /proc/cpuinfo, where this kernel has a PC's: a Pi 4's is put there.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hw_sim.peers import free_ports
from tests.conftest import ROOT

BUILT = ROOT / "build" / "image-arm64"
QEMU = "qemu-aarch64-static"
START = (
    "import sys; sys.path.insert(0, '/opt/bunraku/current/lib/python3.13/site-packages'); "
    "from appliance.start import main; sys.exit(main())"
)
CPUINFO = """processor\t: 0
BogoMIPS\t: 108.00
Features\t: fp asimd evtstrm crc32 cpuid
CPU implementer\t: 0x41
CPU architecture: 8
CPU variant\t: 0x0
CPU part\t: 0xd08
CPU revision\t: 3
"""
# Everything that a program may write is in memory and goes with it: the root stays as it was built.
INSIDE = """
mount -t tmpfs memory "$work" && mkdir "$work/upper" "$work/work" "$work/root"
mount -t overlay -o "lowerdir=$root,upperdir=$work/upper,workdir=$work/work" overlay "$work/root"
root=$work/root
mount --rbind /proc "$root/proc" && mount --bind "$cpuinfo" "$root/proc/cpuinfo"
mount --rbind /dev "$root/dev" && mkdir -p "$root/run/given" && mount --bind "$given" "$root/run/given"
cp "$(command -v qemu-aarch64-static)" "$root/run/qemu"
exec env -i PATH=/usr/bin:/usr/sbin HOME=/root chroot "$root" /run/qemu -cpu cortex-a72 \
    /usr/bin/python3.13 -I -c "$start" "$@"
"""


@pytest.fixture(scope="module")
def root(pytestconfig: pytest.Config) -> Path:
    """The root of a Pi's image, as a folder."""
    if not pytestconfig.getoption("--long") and "BUNRAKU_IMAGE" not in os.environ:
        pytest.skip("an emulated processor takes minutes: make test-long")
    if not (BUILT / "opt/bunraku/current").exists() or os.geteuid() != 0 or shutil.which(QEMU) is None:
        pytest.skip(f"needs root, {QEMU} and {BUILT.relative_to(ROOT)}: make image ARCH=arm64")
    return BUILT


def bunraku_on_arm64(root: Path, folder: Path, *arguments: str) -> str:
    """What a command of bunraku prints there; `folder` is /run/given in it."""
    work, cpuinfo = folder / "work", folder / "cpuinfo"
    work.mkdir(exist_ok=True)
    cpuinfo.write_text(CPUINFO)
    given = {"root": root, "work": work, "cpuinfo": cpuinfo, "given": folder, "start": START}
    environment = {**os.environ, **{name: str(value) for name, value in given.items()}}
    command = ["unshare", "--mount", "--propagation", "private", "sh", "-ec", INSIDE, "bunraku", *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def box_file(folder: Path) -> Path:
    sensors, control, console = free_ports(3)
    path = folder / "box.yaml"
    local = "{{host: 127.0.0.1, port: {}}}".format
    path.write_text(
        f"sensors: {{udp: {local(sensors)}}}\ncontrol: {local(control)}\nconsole: {local(console)}\n"
        f"runtime: {folder / 'runtime'}\nstate: {folder / 'state'}\n"
    )
    return path


def test_it_dances_there(root: Path, tmp_path: Path) -> None:
    said = bunraku_on_arm64(
        root, tmp_path, "play", "--alone", "--seconds", "8", "--journal", "/run/given/journal"
    )
    listed = bunraku_on_arm64(root, tmp_path, "journal", "list", "--journal", "/run/given/journal")
    found = re.search(r": (\d+) s, ", listed)
    assert found is not None, said + listed
    assert int(found[1]) >= 7


def test_a_journal_of_a_pc_is_the_same_dance_there(root: Path, tmp_path: Path) -> None:
    """Within the tolerance that `bunraku replay` states for another processor."""
    play = [sys.executable, "-m", "appliance.cli", "play", "--emulate", "--seconds", "8"]
    play += ["--box", str(box_file(tmp_path)), "--journal", str(tmp_path / "journal")]
    subprocess.run(play, check=True, capture_output=True)
    said = bunraku_on_arm64(root, tmp_path, "replay", "/run/given/journal")
    assert "x86_64 then, aarch64 here" in said
    print(said)
