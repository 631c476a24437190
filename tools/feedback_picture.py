"""The picture of strings that drive joints: `python -m tools.feedback_picture docs/pictures/feedback.png`."""

from __future__ import annotations

import sys

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from appliance.box.clock import TICK_S, Slot
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.instrument import Instrument
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick

KICK_S, SECONDS = 2.0, 10.0
KICK = (2.0, 0.0, 2.0)
HAND = "rHand"
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))


def draw(out: str) -> None:
    """A phrase that stands still, kicked once, without feedback and with it: a hand's way, and the sound."""
    figure = Figure(figsize=(10, 6), layout="constrained")
    hand, *below = figure.subplots(3, 1, sharex=True)
    for axes, gain in zip(below, (0.0, 1.0), strict=True):
        way, samples = _danced(gain)
        hand.plot(np.arange(len(way)) * TICK_S, 100 * (way - way[0]), label=f"feedback {gain:g}")
        axes.specgram(samples, NFFT=4096, Fs=48000, noverlap=3072, vmin=-140, vmax=-50, cmap="magma")
        axes.set(ylim=(50, 2000), ylabel="hertz", title=f"feedback {gain:g}")
    hand.set(ylabel=f"{HAND}, to its side, cm")
    hand.legend(loc="upper right")
    below[-1].set(xlabel=f"seconds; a kick at {KICK_S:g} s")
    figure.savefig(out, dpi=64)


def _danced(gain: float) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    show = load_show(default_show_path())
    parts = assemble(show, BOX)
    springs = parts.led.springs
    if springs is None:
        raise SystemExit("The default show has no springs among its hands.")
    springs.enabled, parts.led.motion.rate = True, 0.0
    springs.call("strings", kicks=False)
    springs.turn("wind", (0.0, 0.0, 0.0))
    springs.turn("feedback", (gain,))
    instrument = Instrument(show.skeleton, show.config.strings or StringsConfig(), SoundConfig())
    instrument.level = 1.0
    parts.led.iterations = Iterations(10, 9, 10)
    tick = Tick(parts, SensorFit(parts, SensorMemory(None)), TICK_S)
    way, heard = [], []
    for number in range(round(SECONDS / TICK_S)):
        if number == round(KICK_S / TICK_S):
            springs.kick(KICK)
        slot = Slot(number, number * TICK_S, number * TICK_S, 0)
        tick.run(slot)
        tick.after(slot)
        positions = tick.frame.puppets[0].positions
        way.append(float(positions[show.skeleton.index(HAND), 0]))
        instrument.dance(positions, slot.deadline)
        heard.append(instrument.render(960))
    parts.close()
    return np.array(way), np.concatenate(heard).mean(axis=1)


if __name__ == "__main__":
    draw(sys.argv[1])
