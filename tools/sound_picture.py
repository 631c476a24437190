"""The spectrogram of the default show's strings: `python -m tools.sound_picture docs/pictures/sound.png`."""

from __future__ import annotations

import sys
import tempfile
import wave
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.render_file import render_file

SECONDS = 8.0


def draw(out: Path) -> None:
    """Eight seconds of the default phrase, played by its strings."""
    show = load_show(default_show_path())
    dance = read_bvh(show.phrase).excerpt(2.0, 2.0 + SECONDS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sound.wav"
        render_file(dance, show.config.strings or StringsConfig(), SoundConfig(), path)
        with wave.open(str(path)) as file:
            rate, count = file.getframerate(), file.getnframes()
            samples = np.frombuffer(file.readframes(count), "<i2").reshape(-1, file.getnchannels())
    figure = Figure(figsize=(10, 4), layout="constrained")
    axes = figure.subplots()
    mono = samples.mean(axis=1) / 32768
    *_, image = axes.specgram(mono, NFFT=8192, Fs=rate, noverlap=7168, vmin=-130, vmax=-40, cmap="magma")
    axes.set(ylim=(50, 3500), xlabel="seconds", ylabel="hertz")
    figure.colorbar(image, ax=axes, label="dB")
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
