"""Sound as a file: a recorded dance through the same instrument, into a WAV of 16 bits."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np

from appliance.pose.recording import Recording
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.instrument import Instrument

RINGS_S = 1.0  # that the file goes on after the dance


def render_file(dance: Recording, strings: StringsConfig, sound: SoundConfig, out: Path) -> float:
    """Write what the strings play to a dance; returns the seconds of the file. Raises OSError."""
    instrument = Instrument(dance.skeleton, strings, sound)
    instrument.level = 1.0
    positions, _ = dance.skeleton.forward_kinematics(dance.poses, dance.roots)
    seconds, place, blocks = len(dance) / dance.fps + RINGS_S, -1, 0
    with wave.open(str(out), "wb") as file:
        file.setnchannels(sound.channels)
        file.setsampwidth(2)
        file.setframerate(sound.rate)
        while (now := blocks * sound.block / sound.rate) < seconds:
            if int(now * dance.fps) != place:
                place = int(now * dance.fps)
                if place < len(dance):
                    instrument.dance(positions[place], place / dance.fps)
                else:
                    instrument.rest()
            block = instrument.render(sound.block)
            file.writeframes(np.round(32767 * block).astype("<i2").tobytes())
            blocks += 1
    return blocks * sound.block / sound.rate
