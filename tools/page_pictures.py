"""docs/pictures/page-*.png, by `python -m tools.page_pictures`: the page on a phone, taken by Chromium.

It starts a box with emulated sensors and a projector; `--address` takes the pictures from another one. Names,
folders and figures that depend on the load of the machine are replaced (`at_rest`): the pictures are the same
on every machine.
"""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from PIL import Image
from playwright.sync_api import Browser, Page, Route, TimeoutError, WebSocketRoute, sync_playwright

from appliance.console.verdict import verdict
from appliance.levers.status import Status
from appliance.stage.fallback import SENSOR_SILENT, TICK_LATE

CHROMIUM = "/usr/bin/chromium-headless-shell"  # without the windows of a desktop
PAGES = ("tonight", "dance", "sensors", "rehearsal", "picture", "prove", "happened", "box", "device")
PHONE = "sensors: {foreign: [{name: right-wrist, from: phone}]}\n"
_FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
_CAPTIONS = {"dance": "#held", "rehearsal": "#figure-said"}  # they say when a frame is drawn
_COLOURS = 96  # a third of the bytes, and nothing that is seen
_WELL_WITHIN_MS = 60_000
_DRAWN_WITHIN_MS = 120_000
_EVENING = 1_767_816_900.0  # 20:15 of an evening
_INSTALLED = {"host": "bunraku", "box_file": "/etc/bunraku/box.yaml", "addresses": [["eth0", "192.168.0.10"]]}
_DANCED_S = 45 * 60.0  # the show has danced this long
_BINS = 240
_LATE, _LATE_S = 2, 1320.0  # ticks, and when; header, figures and journal tell of the same ones
_JOURNAL = (  # second, kind, words
    (4.0, "said", "Sensor left-wrist: neutral pose taken. Dance."),
    (8.0, "order", "look plaster"),
    (610.0, "order", "look lines"),
    (1290.0, "said", "Sensor left-wrist silent for 0.5 s. The dancer moves freely. Check its battery."),
    (1312.0, "said", "Sensor left-wrist is back. It takes its joint again."),
    (1745.0, "order", "look ink"),
    (2480.0, "order", "master 0.8 3.0"),
    (2512.0, "order", "look veil"),
)
_OVER = [
    {"process": "stage", "name": one.name, "times": 1, "active": False, "message": said, "about": about}
    for one, about, said in (
        (SENSOR_SILENT, "left-wrist", SENSOR_SILENT.named.format(about="left-wrist")),
        (TICK_LATE, "", TICK_LATE.message),
    )
]
_LINKED_S = 15.0  # the emulated sensor is on, its neutral pose taken, and no fallback of the start in force


def at_rest(reported: str, now: float) -> str:
    """The status that the server sends each second, as a box with nothing else to do sends it on the evening
    of _JOURNAL, and the server's own verdict on that. now: Unix seconds, which the page shows."""
    value = json.loads(reported)
    if value.get("status") is None:
        return reported
    rest = {"rate_hz": 50.0, "tick_p50_ms": 2.0, "tick_p99_ms": 4.0}
    value["status"] |= {"late": _LATE, "skipped": 0, "fallbacks": 0} | rest
    value |= {"fallbacks": _OVER, "time": now, "since": now - _DANCED_S + _LATE_S}
    value["processes"] = [one | {"late": 0} for one in value["processes"]]
    for sensor in value["sensors"]:
        if sensor["heard"]:
            sensor |= {"rate_hz": 50.0, "loss": 0.0, "round_trip_s": 0.004, "age_s": 0.01}
    judged = verdict(
        *(value["frames"], Status(**value["status"]), value["sensors"], [], value["since"], value["trouble"])
    )
    return json.dumps(value | {"verdict": judged._asdict()})


def _calm(tab: Page, now: float) -> None:
    """From now on the page sees a box at rest; frames and everything else come from the server."""

    def between(browser: WebSocketRoute) -> None:
        server = browser.connect_to_server()
        server.on_message(lambda said: browser.send(at_rest(said, now) if isinstance(said, str) else said))

    def journal(route: Route) -> None:
        answer = route.fetch()
        if answer.status == 200:
            runs = [run_of_the_evening(run, now) for run in answer.json()]
            return route.fulfill(response=answer, json=runs)
        return route.fulfill(response=answer)

    def about(route: Route) -> None:
        answer = route.fetch()
        return route.fulfill(response=answer, json=answer.json() | _INSTALLED)

    tab.route("**/api/box", about)
    tab.route_web_socket("**/watch", between)
    tab.route("**/api/happened", journal)


def run_of_the_evening(run: dict[str, Any], now: float) -> dict[str, Any]:
    """A run of the journal as an evening leaves it: looks, a silent sensor, two late ticks."""
    counts: dict[str, list[int]] = {name: [0] * _BINS for name in ("late", "skipped", "failed")}
    slowest = [round(3.0 + place % 3 * 0.4, 1) for place in range(_BINS)]
    late = int(_LATE_S / _DANCED_S * _BINS)
    counts["late"][late], slowest[late] = _LATE, 26.0
    return {
        **(run | counts),
        "slowest_ms": slowest,
        "bin_s": _DANCED_S / _BINS,
        "seconds": _DANCED_S,
        "events": [list(one) for one in _JOURNAL],
        "begun": now - _DANCED_S,
    }


def take_pictures(
    browser: Browser,
    address: str,
    folder: Path,
    well_within_ms: int = _WELL_WITHIN_MS,
) -> list[Path]:
    """A PNG of each page as a phone shows it. A box that is not well by then is pictured as it is."""
    folder.mkdir(parents=True, exist_ok=True)
    taken = []
    tab = browser.new_page(viewport={"width": 390, "height": 844}, locale="en-GB", timezone_id="Etc/UTC")
    tab.set_default_timeout(_DRAWN_WITHIN_MS)
    _calm(tab, _EVENING)
    tab.goto(address)
    tab.wait_for_selector("#figures dt", state="attached")
    _await_well(tab, well_within_ms)
    for page in PAGES:
        _open(tab, page)
        if page in _CAPTIONS:
            tab.wait_for_selector(f'{_CAPTIONS[page]}:text-matches("Held|No hand")')  # a frame is drawn
        if page == "happened":
            tab.wait_for_selector("#happened-all:not([hidden])", timeout=_WELL_WITHIN_MS)
        if page == "box":
            tab.wait_for_selector("#box-all:not([hidden])", timeout=_WELL_WITHIN_MS)
        tab.wait_for_timeout(500)
        taken.append(folder / f"page-{page}.png")
        tab.screenshot(path=taken[-1])
        _quantized(taken[-1])
    tab.close()
    return taken


def _open(tab: Page, page: str) -> None:
    """Some pages are behind *More* on a phone."""
    tab.evaluate("(page) => document.querySelector(`[data-page=${page}]`).click()", page)
    tab.wait_for_selector(f"#{page}:not([hidden])")


def take_phone(browser: Browser, address: str, folder: Path) -> Path:
    """A PNG of the page that makes a phone a sensor, before it begins."""
    tab = browser.new_page(viewport={"width": 390, "height": 640}, locale="en-GB")
    tab.set_default_timeout(_DRAWN_WITHIN_MS)
    tab.goto(f"{address}/phone")
    tab.wait_for_selector("#begin:enabled")
    taken = folder / "page-phone.png"
    tab.screenshot(path=taken)
    tab.close()
    _quantized(taken)
    return taken


def _quantized(path: Path) -> None:
    """Small colours, as those of a legend, stay what they are."""
    method = Image.Quantize.MAXCOVERAGE
    Image.open(path).convert("RGB").quantize(_COLOURS, method=method, kmeans=1).save(path, optimize=True)


def _await_well(tab: Page, within_ms: int = _WELL_WITHIN_MS) -> None:
    """A busy machine may not be well at all; then the pictures say so."""
    with contextlib.suppress(TimeoutError):
        tab.wait_for_selector("body[data-level=well]", timeout=within_ms)


@contextlib.contextmanager
def _dancing() -> Iterator[str]:
    """Address of the page of a box that dances the show that comes with it, for no receiver."""
    with tempfile.TemporaryDirectory() as scratch:
        box = Path(scratch) / "box.yaml"
        box.write_text("outputs: {osc: []}\nconsole: {port: 0}\ncontrol: {port: 0}\nruntime: run\n" + PHONE)
        bunraku = [sys.executable, "-m", "appliance.cli"]
        command = [*bunraku, "play", "--emulate", "--box", str(box), "--journal", f"{scratch}/night"]
        shown = [*bunraku, "project", "--box", str(box), "--offscreen", "192x108"]
        with (
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
            subprocess.Popen(shown, stdout=subprocess.DEVNULL) as projector,
        ):
            try:
                said = iter(process.stdout or ())
                said_at = (re.search(r"page: (http\S+), PIN", line) for line in said)
                address = next(found[1] for found in said_at if found)
                time.sleep(_LINKED_S)
                yield address
            finally:
                projector.terminate()
                process.terminate()


def main(
    address: Annotated[str | None, typer.Option(help="Of a page; left out: a box is started.")] = None,
    out: Annotated[Path, typer.Option(help="The folder.")] = _FOLDER,
) -> None:
    """Take the pictures of docs/page.md."""
    box = contextlib.nullcontext(address) if address else _dancing()
    with box as found, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for path in take_pictures(browser, found, out):
            print(path)
        print(take_phone(browser, found, out))
        browser.close()


if __name__ == "__main__":
    typer.run(main)
