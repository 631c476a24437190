"""`--emulate`: sensors of the show as a real process that sends real datagrams to the box's own port."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from appliance.box.child import BUNRAKU, end_child, start_child
from appliance.cli.distributions import absent_commands
from appliance.sensor.keys import create_keys
from appliance.show.box import BoxConfig, UdpConfig
from appliance.show.show import ShowConfig
from appliance.stage.stage_error import StageError

_LAST_OUTPUT_S = 2.0
# A double tap, half a second of stillness: the neutral pose is taken; then the hand leads.
_STAND_STILL_S = 0.8
_CALLING_WITHIN_S = 15.0
_OUTPUT = "emulator.txt"


@contextmanager
def emulated(show: ShowConfig, box: BoxConfig, scratch: Path) -> Iterator[BoxConfig]:
    """Run `bunraku emulate` as the show's sensors; yields the box with their key file.

    The venue's own sensors are not admitted meanwhile, and what the box learns about the emulated ones is
    discarded with them. That box has no journal: the venue's is not for rehearsals. Phones and programs stay
    the sensors that they are. Raises StageError.
    """
    others = {one.name for one in box.sensors.foreign}
    worn = dict.fromkeys(hand.sensor for _, hand in show.hands_at if hand.sensor)
    names = [name for name in worn if name not in others]
    journal = box.journal.model_copy(update={"folder": None})
    if worn and not names:
        (scratch / _OUTPUT).write_text("No sensor is emulated.\n")
        sensors = box.sensors.model_copy(update={"keys": None})
        yield box.model_copy(update={"sensors": sensors, "state": None, "journal": journal})
        return
    if not names:
        raise StageError("This show has no sensors to emulate. Leave --emulate out.")
    if missing := absent_commands().get("emulate"):
        raise StageError(f"No sensor can be emulated: {missing}. Or leave --emulate out.")
    keys, log = scratch / "sensors.keys", scratch / _OUTPUT
    create_keys(keys, names)
    udp = box.sensors.udp or UdpConfig()
    command = [
        *(*BUNRAKU, "emulate", "--keys", str(keys), "--motion", "dance"),
        *("--host", udp.host, "--port", str(udp.port), "--stand-still", str(_STAND_STILL_S), "--tap"),
    ]
    sensors = box.sensors.model_copy(update={"udp": udp, "keys": keys})
    with log.open("wb") as output:
        process = start_child(
            command,
            stdout=output,
            stderr=subprocess.STDOUT,
            has_own_session=True,  # Ctrl-C is for the box, which then ends the emulator
        )
    try:
        yield box.model_copy(update={"sensors": sensors, "state": None, "journal": journal})
    finally:
        if process.poll():
            print(f"The emulated sensors ended by themselves: {log.read_text()}", file=sys.stderr)
        end_child(process, _LAST_OUTPUT_S)


def wait_until_calling(scratch: Path) -> None:
    """Until the emulated sensors call the box, so that the hand leads from the dance's first second on.

    Goes on without them after some seconds, or where they ended.
    """
    deadline = time.monotonic() + _CALLING_WITHIN_S
    while not (scratch / _OUTPUT).stat().st_size and time.monotonic() < deadline:
        time.sleep(0.02)
