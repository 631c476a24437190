"""`bunraku check` and `pack`: is the bundle whole, is the box file right, does the dance fit this machine?"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from appliance.body.mesh_file import MESH_FILE, read_mesh
from appliance.cli.network_proof import proved, require_danceable
from appliance.cli.options import SHOW_OR_NAME, BoxFile
from appliance.cli.phones import out_of_phones_reach
from appliance.dancer.material.liveness import what_is_dead
from appliance.dancer.material.maker import open_network
from appliance.dancer.material.motion_network import MotionNetworkError
from appliance.dancer.phrase_cache import PhraseCache
from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_body import write_body
from appliance.levers.sources import MAIN
from appliance.pose.file_trouble import sentence
from appliance.pose.foreign_file import content
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig, load_box
from appliance.show.bundle import (
    CHECKSUMS,
    LARGEST_CHECKSUMS,
    bundle_bytes,
    bundle_files,
    default_show_path,
    named_show,
    write_checksums,
)
from appliance.show.check import not_as_packed, verify_bundle
from appliance.show.config_error import ConfigError
from appliance.show.cues import too_much
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import misplaced, unwired
from appliance.stage.admission import Admission
from appliance.stage.open_sensors import reach
from appliance.stage.stage_error import StageError
from appliance.stage.stage_parts import StageParts, assemble, measure_admission

_PATIENCE_S = 60.0  # a user can wait longer than a box at power-on


def check(
    show: Annotated[Path | None, typer.Argument(callback=named_show, help=SHOW_OR_NAME)] = None,
    box: BoxFile = None,
    named: Annotated[
        Path | None, typer.Option("--show", callback=named_show, help="Show, as `play` takes it.")
    ] = None,
) -> None:
    """Check a show and a box file, and measure whether the iterations fit this machine."""
    if show is not None and named is not None:
        raise typer.BadParameter("name one show, with --show or without")
    check_show(show or named, box)


def check_show(directory: Path | None, box_file: Path | None, patience_s: float = _PATIENCE_S) -> None:
    """Print what was found; raises StageError with all that is wrong."""
    directory = directory or default_show_path()
    print(proved(_network(directory), lambda: _check(directory, box_file), patience_s), end="")


def _network(directory: Path) -> Path:
    """The file to blame for a check that never ends: all others are read within bounds."""
    try:
        return load_show(directory).network
    except ConfigError:
        return directory


def _check(directory: Path, box_file: Path | None) -> None:
    parts, verdict = verified_parts(directory, box_file)
    show, box = load_show(directory), load_box(box_file)
    if box.sensors.keys is not None and parts.complaints:
        raise StageError("\n".join(parts.complaints))
    if not verdict.fits:
        raise StageError(verdict.sentence())
    _refuse_motion_networks(show)
    print(f"{show.config.name}: the bundle is whole.")
    print(verdict.sentence())
    too_many = too_much(show.config.cues, verdict.most_coding, show.file)
    found = (
        *reach(list(parts.worn), box),
        *out_of_phones_reach(box),
        *unwired(show.config, box),
        *too_many,
        *_dead_networks(show),
        *_no_mesh(show),
    )
    for warning in found:
        print(warning)


def verified_parts(directory: Path, box_file: Path | None) -> tuple[StageParts, Admission]:
    """The parts of a show that can dance on this box, without ports, and what its iterations cost here.

    Raises StageError or ConfigError with all that is wrong.
    """
    box = load_box(box_file)
    _refuse_damage(directory)
    show = load_show(directory)
    _refuse_misfits(show, box)
    _refuse_missing_secret(box)
    parts = assemble(show, without_ports(box))
    verdict = measure_admission(parts, box)
    parts.close()
    return parts, verdict


def pack(show: Annotated[Path, typer.Argument(help="The show bundle that you changed.")]) -> None:
    """Check a show that you changed, and write its checksums anew."""
    network = load_show(show).network
    checksums = show / CHECKSUMS
    try:
        before = content(checksums, LARGEST_CHECKSUMS) if checksums.exists() else None
        write_checksums(show)
    except OSError as error:
        raise StageError(f"{sentence(error, show)} Nothing was changed.") from error
    try:
        print(proved(network, lambda: _refuse_damage(show)), end="")
    except StageError:
        checksums.unlink() if before is None else checksums.write_bytes(before)
        raise
    try:
        if write_body(show, load_show(show).skeleton):
            write_checksums(show)
    except ExchangeError as error:
        raise StageError(f"{error} The show keeps the body that it had.") from error
    except OSError as error:
        raise StageError(f"{sentence(error, show)} Pack the show again.") from error
    size_mb = bundle_bytes(show) / 1e6
    print(f"{show}: {len(bundle_files(show))} files, {size_mb:.1f} MB, packed in {CHECKSUMS}.")


def _refuse_damage(directory: Path) -> None:
    findings = verify_bundle(directory)
    for warning in (finding for finding in findings if finding.level == "warning"):
        print(warning)
    require_danceable(findings)
    changed = [str(finding) for finding in findings if finding.level == "error"]
    if changed:
        raise StageError("\n".join([not_as_packed(directory), *changed]))


def _refuse_motion_networks(show: Show) -> None:
    """Raises ConfigError where a source's network is none of this figure: it would make nothing on stage."""
    problems = []
    for source, file in show.motion_networks.items():
        try:
            open_network(source, file, show.skeleton.names)
        except MotionNetworkError as error:
            cure = "Copy the file again, or train it on this dancer's recordings."
            problems.append(show.file.problem(("motion", source), f"{file.name}: {error}", cure))
    if problems:
        raise ConfigError(problems)


def _no_mesh(show: Show) -> Iterator[str]:
    """A note where the projector models the body at its start."""
    if read_mesh(show.directory, show.skeleton) is None:
        yield (
            f"The bundle has no {MESH_FILE} for this skeleton: the projector models the body at every start, "
            f"which takes half a second or more. bunraku pack {shlex.quote(str(show.directory))} writes it."
        )


def _dead_networks(show: Show) -> Iterator[str]:
    """A warning where a source's network would make the same motion whatever it is asked, or a finger on the
    map would change next to nothing.
    """
    found = PhraseCache(show.directory, None).phrase(show.phrases[MAIN], show.skeleton, False)
    if found is None:
        return
    sources = {file: source for source, file in show.motion_networks.items()}
    for file, source in sources.items():
        network = open_network(source, file, show.skeleton.names)
        if dead := what_is_dead(network, found[0].poses[:, network.places]):
            yield f"{file.name}: {dead}"


def _refuse_misfits(show: Show, box: BoxConfig) -> None:
    """Raises ConfigError where the box file names joints or fixtures that do not fit this show."""
    problems = [
        *box.output_misfits(show.skeleton.names, len(show.config.cast)),
        *misplaced(show, box),
    ]
    if problems:
        raise ConfigError(problems)


def _refuse_missing_secret(box: BoxConfig) -> None:
    """Raises ConfigError where a box of several lacks their secret: its stage would not start."""
    for section in (box.pair, box.locked):
        if section is not None:
            from appliance.stage.paired import secret_in

            secret_in(section.secret)


def without_ports(box: BoxConfig) -> BoxConfig:
    """The same box with its ports closed: a check may run beside the show."""
    return box.model_copy(
        update={
            "sensors": SensorsConfig(udp=None, keys=box.sensors.keys),
            "outputs": OutputsConfig(osc=[]),
            "control": None,
        }
    )
