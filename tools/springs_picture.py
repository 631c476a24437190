"""The picture of springs: `python -m tools.springs_picture docs/pictures/springs.png`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from appliance.box.clock import TICK_S, Slot
from appliance.pictures.filmstrip import draw_filmstrip
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.show.springs import built_in
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick

BEFORE_S, SECONDS = 2.0, 4.0
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))


def draw(out: Path) -> None:
    """The default phrase, and below it the same with each built-in setting on the upper body."""
    with tempfile.TemporaryDirectory() as folder:
        settings = ["", *(setting.name for setting in built_in())]
        strips = [_strip(Path(folder) / f"{name or 'none'}.png", name) for name in settings]
        images = [Image.open(strip).convert("RGB") for strip in strips]
    whole = Image.new("RGB", (images[0].width, sum(image.height for image in images)))
    top = 0
    for image in images:
        whole.paste(image, (0, top))
        top += image.height
    whole.resize((whole.width * 2 // 3, whole.height * 2 // 3)).quantize(128).save(out, optimize=True)


def _strip(out: Path, setting: str) -> Path:
    show = load_show(default_show_path())
    parts = assemble(show, BOX)
    springs = parts.led.springs
    if springs is None:
        raise SystemExit("The default show has no springs among its hands.")
    springs.settings, springs.enabled = {one.name: one for one in built_in()}, bool(setting)
    springs.call(setting or "loose")
    parts.led.iterations = Iterations(10, 9, 10)
    tick = Tick(parts, SensorFit(parts, SensorMemory(None)), TICK_S)
    poses, roots = [], []
    for number in range(round((BEFORE_S + SECONDS) / TICK_S)):
        slot = Slot(number, number * TICK_S, number * TICK_S, 0)
        tick.run(slot)
        tick.after(slot)
        poses.append(tick.frame.puppets[0].pose.copy())
        roots.append(tick.frame.puppets[0].root.copy())
    parts.close()
    begin = round(BEFORE_S / TICK_S)
    title = f"springs: {setting}" if setting else "without springs"
    danced = np.array(poses[begin:]), np.array(roots[begin:])
    return draw_filmstrip(out, show.skeleton, *danced, 1 / TICK_S, title=title, rows=1)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
