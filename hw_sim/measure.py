"""`bunraku measure`: proves before the doors open how fast the box answers and how evenly it ticks."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from appliance.pose.file_trouble import sentence
from appliance.pose.foreign_file import content
from appliance.sensor.keys import create_keys
from hw_sim.bundled_shows import show_folder
from hw_sim.emulated_sensor import REBOOT_S
from hw_sim.figures import FREE_SETTLING_S, SETTLING_S, TRANSPORT_MS, Evidence, figures_of, table, verdict
from hw_sim.peers import ProbeError, Setting, scratch_folder
from hw_sim.probe import Course, Run, run, run_restarts
from hw_sim.progress import Progress
from hw_sim.screen import Screen

REFUSED, FAILED = 2, 1
BEAT_S = 0.02
FEWEST_STEPS_S = 3.0  # seconds of the shortest run: two or three steps
_LARGEST_YAML = 1 << 20
LOCKED_DRIFT_PPM = 60.0  # what a wearable's crystal may be off by; the lock has to follow it
POWERED_S = 1.5  # how long a sensor is on until it is switched off again
POWERED_FIRMWARE_S = 5.0  # the firmware joins a simulated Wi-Fi first, which takes seconds
_CUE_S = 4.0  # until the strings have come in
MOST_POWER_ONS, MOST_RESTARTS = 9, 5


def measure(
    seconds: Annotated[
        float, typer.Option(min=4.0, help="Length of the phase-locked run; 120 for 6,000 ticks.")
    ] = 30.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures here.")] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write measure.png and measure.json into this folder.")
    ] = None,
    show: Annotated[
        Path | None, typer.Option(help="Show bundle. Default: the one that comes with the box.")
    ] = None,
    box: Annotated[
        Path | None, typer.Option(help="box.yaml of the venue: its limits and real-time settings.")
    ] = None,
    firmware: Annotated[
        bool, typer.Option("--firmware", help="The compiled firmware is the sensor (make firmware).")
    ] = False,
    light: Annotated[
        bool,
        typer.Option("--light", help="From the hand to the light too: needs an X11 screen, and fills it."),
    ] = False,
    progress: Annotated[
        Path | None,
        typer.Option(help="Write what is measured into this file meanwhile, as JSON objects, one a line."),
    ] = None,
) -> None:
    """Measure the whole way, datagram in to datagram out, with an emulated sensor on a venue's network.

    Two runs: the tick in phase with the sensor, then running free, with no wait for late readings, while the
    sensor's clock drifts through one whole beat, so that every offset between the two counts alike. Then how
    soon a reading is used after the sensor's power-on, and after the box was killed and restarted. If the
    show has strings, and the box file does not silence them, they play on an emulated sound card. --light
    adds the projector: each picture says in a corner when its dance left the stage, and is read back from the
    screen. Exit status 0 when all limits hold, else 1.
    """
    try:
        if report is not None and find_spec("matplotlib") is None:
            raise ProbeError(
                "The picture of --report needs matplotlib, which is missing here: nothing was measured. "
                "Leave --report out (--json FILE writes the figures), or: pip install 'bunraku[pictures]'"
            )
        if light:
            Screen().close()
        for folder in (report, None if json_file is None else json_file.parent):
            if folder is not None:  # before minutes are measured for nothing
                folder.mkdir(parents=True, exist_ok=True)
        with scratch_folder("bunraku-measure-") as scratch:
            setting, page = _setting(show, box, scratch, firmware), Progress(progress)
            parts = 5 if setting.sounds else 4
            print(f"Measuring {seconds:g} s in phase with the sensor ...", flush=True)
            page.report(
                phase="locked",
                parts=parts,
                seconds=seconds,
                settling_s=min(SETTLING_S, seconds / 2.0),
                limits=[{"label": label, "most": most} for label, (_, most) in TRANSPORT_MS.items()],
            )
            locked = run(setting, locked_course(seconds), page)
            free_s = max(6.0, seconds / 3.0)
            print(f"Measuring {free_s:g} s running free ...", flush=True)
            page.report(phase="free", parts=parts, seconds=free_s, settling_s=FREE_SETTLING_S)
            free = run(setting, free_course(free_s), page)
            course = power_on_course(seconds, POWERED_FIRMWARE_S if firmware else POWERED_S)
            print(f"Switching the sensor on and off for {course.seconds:g} s ...", flush=True)
            page.report(phase="power-ons", parts=parts, seconds=course.seconds)
            power_ons = run(setting, course)
            times = min(max(2, round(seconds / 6)), MOST_RESTARTS)
            print(f"Killing and starting the box {times} times ...", flush=True)
            page.report(phase="restarts", parts=parts, times=times)
            restarts = run_restarts(setting, times)
            heard = None
            if setting.sounds:
                print(f"Listening to the strings for {free_s:g} s ...", flush=True)
                page.report(phase="sound", seconds=free_s)
                heard = run(setting, sound_course(free_s))
            light_steps: Run | None = None
            light_dance: Run | None = None
            if light:
                print(f"Watching the projector's pictures for {free_s:g} s ...", flush=True)
                steps, dance = light_courses(free_s)
                light_steps, light_dance = run(setting, steps), run(setting, dance)
            evidence = Evidence(
                *(locked, free, power_ons, restarts, course.switched_on),
                *(firmware, light_steps, light_dance, heard),
            )
    except (ProbeError, OSError, ValueError) as error:
        raise _refused(error) from None
    figures = figures_of(evidence)
    limits = verdict(figures)
    page.report(figures=figures, limits=[limit._asdict() | {"holds": limit.holds} for limit in limits])
    for line in table(figures, limits):
        print(line)
    written = [json_file] if json_file is not None else []
    try:
        if report is not None:
            from hw_sim.report import draw_report

            written.append(report / "measure.json")
            print(f"Picture: {draw_report(report / 'measure.png', evidence)}")
        for path in written:
            path.write_text(json.dumps(figures, indent=2) + "\n")
    except OSError as error:
        raise _refused(error) from None
    raise typer.Exit(0 if all(limit.holds for limit in limits) else FAILED)


def _refused(error: Exception) -> typer.Exit:
    message = sentence(error) if isinstance(error, OSError) else None
    print(f"bunraku measure: {message or error}", file=sys.stderr)
    return typer.Exit(REFUSED)


def locked_course(seconds: float) -> Course:
    """In phase; the last part with the phrase standing still, for the response to steps, one a second."""
    standing_s = min(12.0, max(FEWEST_STEPS_S, seconds / 3.0))
    return Course("locked", seconds, standing_s, drift_ppm=LOCKED_DRIFT_PPM)


def free_course(seconds: float) -> Course:
    """Running free; the sensor's clock loses one beat of 20 ms in the time that counts."""
    drift_ppm = -1e6 * BEAT_S / (seconds - FREE_SETTLING_S)
    return Course("free", seconds, phase_lock=False, drift_ppm=drift_ppm, seed=2)


def power_on_course(seconds: float, powered_s: float) -> Course:
    """The sensor is switched off and on again and again; once in each third second of the given ones."""
    power_ons = min(max(2, round(seconds / 3)), MOST_POWER_ONS)
    return Course("power-ons", (powered_s + REBOOT_S) * power_ons, seed=3, reboot_every_s=powered_s)


def sound_course(seconds: float) -> Course:
    """In phase, with the strings; the phrase stands still when their cue has faded in."""
    return Course("sound", seconds + _CUE_S, seconds, drift_ppm=LOCKED_DRIFT_PPM, seed=5, sounds=True)


def light_courses(seconds: float) -> tuple[Course, Course]:
    """In phase, with the projector: a hand that steps, one that dances; the phrase soon stands still."""
    steps = Course("light", seconds, seconds - 2.0, drift_ppm=LOCKED_DRIFT_PPM, seed=4, projects=True)
    return steps, replace(steps, name="light-dance", dances=True)


def _setting(show: Path | None, box: Path | None, scratch: Path, firmware: bool) -> Setting:
    """Reads of show and box file only what the measurement needs; the box itself checks the rest."""
    show = show_folder(show)
    config, venue = _plain_yaml(show / "show.yaml"), _plain_yaml(box) if box is not None else {}
    try:
        return _followed(show, config, venue, box is not None, scratch, firmware)
    except (AttributeError, KeyError, TypeError):
        raise ProbeError(
            f"{show / 'show.yaml'}: something in it cannot be. `bunraku check` says where."
        ) from None


def _followed(
    show: Path, config: dict[str, Any], venue: dict[str, Any], is_venue: bool, scratch: Path, firmware: bool
) -> Setting:
    """The setting that measures the show's primary sensor. Raises ProbeError for a show without a sensor."""
    hands = [hand for hand in config.get("hands") or [] if isinstance(hand, dict) and hand.get("sensor")]
    if not hands:
        raise ProbeError(f"{show}: no sensor holds a joint in this show, so there is no way to follow.")
    followed = next((hand for hand in hands if hand.get("primary")), hands[0])
    strings = config.get("strings")
    keys = scratch / "sensors.keys"
    create_keys(keys, list(dict.fromkeys(hand["sensor"] for hand in hands)))
    return Setting(
        show=show.resolve(),
        box=venue,
        keys=keys,
        sensor=followed["sensor"],
        joint=followed["joint"],
        scratch=scratch,
        firmware=firmware,
        sounds=strings is not None and (not is_venue or venue.get("sound") is not None),
        cue=str(next(iter((strings or {}).get("cues") or ()), "")),
    )


def _plain_yaml(path: Path) -> dict[str, Any]:
    try:
        values = yaml.safe_load(content(path, _LARGEST_YAML).decode()) or {}
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ProbeError(f"{path}: is not YAML. `bunraku check` says where.") from error
    if not isinstance(values, dict):
        raise ProbeError(f"{path}: does not consist of keys. `bunraku check` says more.")
    return values
