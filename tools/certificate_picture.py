"""docs/pictures/certificate.png, by `python -m tools.certificate_picture FOLDER`: a measurement, with notes.

FOLDER: what `bunraku measure --report FOLDER` wrote. Each limit gets a line that says what it means.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from hw_sim.figures import verdict

NOTES = {  # for each limit, in the order of the verdict: beginning of its words, what it means
    "transport, median": "A reading comes in: so long until the frame that uses it leaves.",
    "transport, p99": "The same for 99 of 100 readings: no hitch that a dancer would feel.",
    "transport, median, against": "In phase with the sensor: running free takes 4 times as long.",
    "response": "The sensor jumps: so long until the held joint has gone half of the way.",
    "tick, median": "One step of the dance, of the 20 ms that it has.",
    "tick, p99": "The slow ones. The rest is the reserve for a hotter day.",
    "late ticks": "Frames that left too late, or not: the last pose was sent again.",
    "missing frames": "Frames that nobody received.",
    "memory": "All of the stage, as a small computer must hold it.",
    "start to": "From the start of the program to the first frame.",
    "sensor's power-on": "Somebody switches a sensor on: so long until it leads.",
    "box's restart": "The box is killed: so long from its new start to a led frame.",
    "the same": "The same, counted from the moment at which it was killed.",
    "hand to sound": "The sensor jumps: so long until the sound card plays the first change.",
    "hand to light": "From the hand to the picture on a screen.",
    "dance to light": "The same for a hand that dances: the wall predicts it.",
}
WIDTH, LINE, TOP, PLOT = 1210, 54, 150, 392  # pixels; the first plot of the report is kept
SIDE, PADDING = 40, 18  # margins of the sheet, and within the plot's ground
PAPER, INK, FAINT, GOOD, BAD = "#faf8f4", "#1d1d22", "#6b6b75", "#1f7a3f", "#b3261e"


def draw_certificate(folder: Path, out: Path) -> Path:
    """The histogram of the transport, and below it each limit with its figure and its note."""
    figures = json.loads((folder / "measure.json").read_text())
    limits = verdict(figures)
    failed = sum(not limit.holds for limit in limits)
    image = Image.new("RGB", (WIDTH, TOP + PLOT + LINE * len(limits) + 40), PAPER)
    pen = ImageDraw.Draw(image)
    large, plain, small = (ImageFont.load_default(size) for size in (34, 20, 17))
    passed = "All limits hold" if not failed else f"{failed} of {len(limits)} limits do not hold"
    pen.text((40, 34), passed, font=large, fill=BAD if failed else GOOD)
    counted = f"{figures['ticks']} ticks, {figures['readings']} readings, {figures['power_ons']} power-ons, "
    counted += (
        f"{figures['restarts']} restarts. No screen, no lamp, no real sensor or radio is in these figures."
    )
    pen.text((40, 92), counted, font=small, fill=FAINT)
    plot = Image.open(folder / "measure.png").crop((0, 0, WIDTH, PLOT))
    image.paste(framed(plot), (SIDE, TOP - 10))
    for number, limit in enumerate(limits):
        y = TOP + PLOT + LINE * number
        mark, colour = ("ok", GOOD) if limit.holds else ("FAIL", BAD)
        value = "nothing came" if limit.value is None else f"{limit.value:.2f} {limit.unit}"
        pen.text((40, y), mark, font=plain, fill=colour)
        pen.text((110, y), limit.label, font=plain, fill=INK)
        pen.text((930, y), value, font=plain, fill=INK, anchor="ra")
        pen.text((960, y), f"at most {limit.most:.2f} {limit.unit}", font=plain, fill=FAINT)
        pen.text((110, y + 25), note_of(limit.label), font=small, fill=FAINT)
    image.quantize(64).save(out, optimize=True)
    return out


def framed(plot: Image.Image) -> Image.Image:
    """The plot within the sheet's margins, on a ground of the same colour."""
    whole = Image.new("RGB", (WIDTH - 2 * SIDE, PLOT - 20), plot.convert("RGB").getpixel((0, 0)))
    scale = min((whole.width - 2 * PADDING) / plot.width, (whole.height - 2 * PADDING) / plot.height)
    small = plot.resize((round(plot.width * scale), round(plot.height * scale)), Image.Resampling.LANCZOS)
    whole.paste(small, ((whole.width - small.width) // 2, PADDING))
    return whole


def note_of(text: str) -> str:
    """The meaning of a limit, by the longest beginning that fits. Raises KeyError for one without a note."""
    return NOTES[max((begin for begin in NOTES if text.startswith(begin)), key=len, default=text)]


if __name__ == "__main__":
    drawn = Path(sys.argv[2] if len(sys.argv) > 2 else "docs/pictures/certificate.png")
    print(draw_certificate(Path(sys.argv[1]), drawn))
