"""Records the golden journal anew (`python -m tests.recorder.make_golden_journal`): a night with faults.

A sensor falls silent while it holds a joint, and comes back from another power-on; the network fails for
half a second; the machine is busy and ticks come late; then the stage is killed and started again.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from appliance.recorder.export import export
from tests.bundles import write_show
from tests.recorder.night import Night, reading

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "fault.bunraku"
STILL, RAISED, LOWERED = (1.0, 0.0, 0.0, 0.0), (0.8, 0.6, 0.0, 0.0), (0.8, -0.6, 0.0, 0.0)
SILENT, FAILED, LATE = range(200, 260), range(300, 325), range(340, 344)
BEFORE, AFTER = 400, 100


def write_faulty_show(folder: Path) -> Path:
    """The show of that night: its network fails at seven coding iterations."""
    return write_show(folder, network="fragile")


def record(scratch: Path) -> Path:
    """The journal of that night, as a folder."""
    show, runtime = write_faulty_show(scratch / "show"), scratch / "runtime"
    night = Night(show, runtime)
    night.dance(60, reading(STILL))
    night.order("neutral")
    night.dance(SILENT.start - 60, reading(RAISED))
    night.dance(len(SILENT))
    night.dance(FAILED.start - SILENT.stop, reading(LOWERED, boot_nonce=2))
    night.command("/iterations", 7.0, 6.0)
    night.dance(len(FAILED), reading(RAISED, boot_nonce=2))
    night.command("/iterations", 3.0, 2.0)
    night.dance(LATE.start - FAILED.stop, reading(RAISED, boot_nonce=2))
    night.dance(len(LATE), reading(RAISED, boot_nonce=2), late_s=0.015)
    night.dance(BEFORE - LATE.stop, reading(RAISED, boot_nonce=2))
    journal = night.saved(scratch / "journal")
    again = Night(show, runtime, begins_at=2000.0)
    again.dance(AFTER, reading(RAISED, boot_nonce=2))
    return again.saved(journal)


def main() -> None:
    """Write it."""
    scratch = Path(tempfile.mkdtemp())
    try:
        print(export(record(scratch), GOLDEN))
    finally:
        shutil.rmtree(scratch)


if __name__ == "__main__":
    main()
