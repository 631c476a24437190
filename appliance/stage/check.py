"""`bunraku check`: is the show bundle whole, is the box file right, and does the dance fit this machine?"""

from __future__ import annotations

from pathlib import Path

from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.check import verify_bundle
from appliance.show.show import load_show
from appliance.stage.cast import admission, assemble
from appliance.stage.stage_error import StageError


def check_show(directory: Path | None, box_file: Path | None) -> None:
    """Print what was found; raises StageError or ConfigError with all that is wrong."""
    directory = directory or default_show_path()
    box = load_box(box_file)
    findings = verify_bundle(directory)
    for warning in (finding for finding in findings if finding.level == "warning"):
        print(warning)
    errors = [str(finding) for finding in findings if finding.level == "error"]
    if errors:
        raise StageError("\n".join(["This show cannot be danced.", *errors]))
    show = load_show(directory)
    cast = assemble(show, _without_ports(box))
    verdict = admission(cast, show, box)
    cast.close()
    if not verdict.fits:
        raise StageError(verdict.sentence())
    print(f"{show.config.name}: the bundle is whole.")
    print(verdict.sentence())


def _without_ports(box: BoxConfig) -> BoxConfig:
    """The same box with its ports closed: a check may run beside the show."""
    return box.model_copy(
        update={
            "sensors": SensorsConfig(udp=None, keys=box.sensors.keys),
            "outputs": OutputsConfig(osc=[]),
            "control": None,
        }
    )
