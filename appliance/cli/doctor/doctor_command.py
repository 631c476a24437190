"""`bunraku doctor`: one check after the other, a table, an exit status."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator

from rich.console import Console
from rich.table import Table
from rich.text import Text

from appliance.cli.doctor import box_state, processor, show_parts, storage, venue
from appliance.cli.doctor.finding import ORDER, Finding, wrong
from appliance.cli.doctor.host_view import HostView, running_stage
from appliance.cli.doctor.sample import Sample, sample
from appliance.cli.options import AsJson, ChosenFile, ThisBoxFile
from appliance.release.installed_box import box_here
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError

CHECKS = (
    box_state.stage,
    show_parts.sensors,
    show_parts.receivers,
    show_parts.wires,
    storage.choice,
    storage.releases,
    box_state.units,
    processor.realtime_rights,
    processor.locked_memory,
    processor.governor,
    processor.temperature,
    processor.power,
    storage.memory,
    storage.data_folders,
    storage.media,
    storage.system_partition,
    storage.wear,
    box_state.watchdog,
    box_state.clock,
    venue.ports,
    venue.pair,
    venue.network,
    venue.radios,
    venue.access_point,
    venue.cables,
    venue.adapters,
    venue.display,
)
LOOKS = (processor.wakeup_latency, processor.others, processor.interrupts)
_COLOURS = {"wrong": "bold red", "better": "yellow", "ok": "green"}


def doctor(box: ThisBoxFile = None, chosen: ChosenFile = None, as_json: AsJson = False) -> int:
    """Look at machine, venue and running box, and say what to do; status 1 when something is wrong."""
    found: list[Finding] = []
    try:
        config = load_box(box_here(box, chosen))
    except ConfigError as error:
        config = BoxConfig()
        found.append(wrong("box file", str(error), "Below, a box without a box file is looked at."))
    found += findings(HostView(box=config, stage=running_stage(config)))
    found.sort(key=lambda finding: ORDER.index(finding.verdict))
    if as_json:
        print(json.dumps([finding._asdict() for finding in found], indent=1))
    else:
        _show(found)
    return int(any(finding.verdict == "wrong" for finding in found))


def findings(host: HostView) -> Iterator[Finding]:
    """The findings of all checks; some of them measure for five seconds."""
    for check in CHECKS:
        yield from check(host)
    if host.is_here:
        seen = _sampled(host)
        for look in LOOKS:
            yield from look(seen)


def _sampled(host: HostView) -> Sample:
    """A sample, without the box's own processes."""
    ours = {os.getpid()}
    ours |= {int(folder.name) for folder in host.found("/proc/[0-9]*") if host.is_bunraku(folder)}
    return sample(host.box.realtime.priority, frozenset(ours))


def _show(found: list[Finding]) -> None:
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 2, 0, 0))
    for _ in range(3):
        table.add_column(overflow="fold")
    for finding in found:
        message = Text(finding.message)
        if finding.cure:
            message.append(f"\n-> {finding.cure}", style="dim")
        table.add_row(Text(finding.verdict, style=_COLOURS[finding.verdict]), Text(finding.what), message)
    console = Console(highlight=False)
    console.print(table)
    count = {verdict: sum(one.verdict == verdict for one in found) for verdict in ORDER}
    console.print(f"\n{count['ok']} ok, {count['better']} could be better, {count['wrong']} wrong.")
