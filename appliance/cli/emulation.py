"""`--emulate`: sensors of the show as a real process that sends real datagrams to the box's own port."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path
from types import TracebackType

from appliance.sensor.keys import create_keys
from appliance.show.box import BoxConfig, UdpConfig
from appliance.show.show import Show
from appliance.stage.stage_error import StageError

_LAST_WORDS_S = 2.0


class Emulation:
    """A context: starts `python -m hw_sim emulate` for the show's sensors and ends it.

    `box` is the given box with the key file of these sensors: the venue's own are not let in meanwhile, and
    what is learnt of these is forgotten with them. It has no journal: the venue's is not for rehearsals.
    """

    def __init__(self, show: Show, box: BoxConfig, scratch: Path) -> None:
        names = list(dict.fromkeys(hand.sensor for hand in show.config.hands if hand.sensor))
        if not names:
            raise StageError("This show has no sensors to emulate. Leave --emulate out.")
        keys = scratch / "sensors.keys"
        create_keys(keys, names)
        udp = box.sensors.udp or UdpConfig()
        self._command = [
            *(sys.executable, "-m", "hw_sim", "emulate", "--keys", str(keys), "--motion", "dance"),
            *("--host", udp.host, "--port", str(udp.port)),
        ]
        sensors = box.sensors.model_copy(update={"udp": udp, "keys": keys})
        journal = box.journal.model_copy(update={"folder": None})
        self.box = box.model_copy(update={"sensors": sensors, "state": None, "journal": journal})
        self._words = scratch / "emulator.txt"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Emulation:
        with self._words.open("wb") as words:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=words,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for the box, which then ends the emulator
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        process = self._process
        if process is None:
            return
        if process.poll():
            print(f"The emulated sensors ended by themselves: {self._words.read_text()}", file=sys.stderr)
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_LAST_WORDS_S)
        process.kill()
        process.wait()
