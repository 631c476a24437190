"""The sensors as a table for people and as plain values for programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

from appliance.box.roster import UNKNOWN_S, RosterLine
from appliance.sensor.keys import SensorKey
from appliance.sensor.state import LOW_BATTERY
from appliance.sensor.wire import BATTERY_UNKNOWN, HAS_CRYSTAL, HAS_PROFILE, IS_NDOF, signal_dbm

HIGH_LOSS = 0.05
HIGH_ROUND_TRIP_S = 0.1
OLD_S = 0.5
WEAK_DBM = -75
_COLOURS = {"linked": "green", "greeted": "yellow", "lost": "bold red", "absent": "dim"}
_NEUTRAL_COLOURS = {"wanted": "yellow", "assumed": "yellow"}
_ANY_WIDTH = 1000
_NONE = Text("-", style="dim")


def unheard(keys: Mapping[str, SensorKey]) -> list[RosterLine]:
    """The sensors of a key file, with nothing else known about them."""
    return [
        RosterLine(
            *(key.name, f"{key.device_id:08x}", "", "", 0.0, 0.0, UNKNOWN_S, UNKNOWN_S, BATTERY_UNKNOWN),
            *(0, 0, "", "", "", ""),
        )
        for key in keys.values()
    ]


class SensorTable:
    """A row for each sensor, problems coloured; several tables where one is too wide."""

    def __init__(self, lines: Sequence[RosterLine]) -> None:
        self._lines = lines

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        unbounded = options.update_width(_ANY_WIDTH)
        columns = [_NAME]
        tells_signal = any(signal_dbm(line.flags) is not None for line in self._lines)
        for column in _COLUMNS:
            if column is _SIGNAL and not tells_signal:  # older wearables do not
                continue
            wider = self._table([*columns, column])
            if console.measure(wider, options=unbounded).maximum > options.max_width and len(columns) > 1:
                yield self._table(columns)
                yield ""
                columns = [_NAME]
            columns.append(column)
        yield self._table(columns)

    def _table(self, columns: Sequence[_Column]) -> Table:
        table = _bare_table()
        for column in columns:
            table.add_column(column.heading, justify=column.justify, no_wrap=True)
        for line in self._lines:
            table.add_row(*(column.cell(line) for column in columns))
        return table


def known_table(lines: Sequence[RosterLine]) -> Table:
    """Only names and ids, without a running box."""
    table = _bare_table()
    table.add_column("name")
    table.add_column("id")
    for line in lines:
        table.add_row(Text(line.name, style="bold"), line.device_id)
    return table


def plain_values(line: RosterLine) -> dict[str, object]:
    """One sensor for a program: seconds, shares, hertz; null where nothing is known."""
    is_heard = line.rate_hz > 0 or line.age_s >= 0
    return {
        "name": line.name,
        "id": line.device_id,
        "state": line.state or None,
        "way": line.way or None,
        "rate_hz": round(line.rate_hz, 2),
        "loss": round(line.loss, 4),
        "round_trip_s": _seconds(line.round_trip_s),
        "age_s": _seconds(line.age_s),
        "battery_percent": None if line.battery == BATTERY_UNKNOWN else line.battery,
        "battery_left_s": _seconds(line.battery_left_s),
        "calibration": _levels(line.calibration) if is_heard else None,
        "has_profile": bool(line.flags & HAS_PROFILE),
        "fusion": ("ndof" if line.flags & IS_NDOF else "imuplus") if is_heard else None,
        "firmware": line.firmware or None,
        "imu": line.imu_id or None,
        "neutral": line.neutral or None,
        "heading_corrected_degrees": round(line.corrected, 2),
        "complaint": line.complaint or None,
    } | _newer_fields(line)


def _newer_fields(line: RosterLine) -> dict[str, object]:
    """Fields that older wearables do not report."""
    dbm = signal_dbm(line.flags)
    return {} if dbm is None else {"signal_dbm": dbm, "has_crystal": bool(line.flags & HAS_CRYSTAL)}


def _bare_table() -> Table:
    return Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))


def _seconds(seconds: float) -> float | None:
    return None if seconds < 0 else round(seconds, 5)


def _levels(register: int) -> dict[str, int]:
    """System, gyroscope, accelerometer, magnetometer: two bits each, 3 is best."""
    return {
        "system": register >> 6 & 3,
        "gyro": register >> 4 & 3,
        "accel": register >> 2 & 3,
        "mag": register & 3,
    }


def _rate(line: RosterLine) -> Text:
    return Text(f"{line.rate_hz:.0f} Hz") if line.rate_hz > 0 else _NONE


def _loss(line: RosterLine) -> Text:
    if line.rate_hz <= 0:
        return _NONE
    return Text(f"{100 * line.loss:.1f} %", style="yellow" if line.loss > HIGH_LOSS else "")


def _round_trip(line: RosterLine) -> Text:
    if line.round_trip_s < 0:
        return _NONE
    style = "yellow" if line.round_trip_s > HIGH_ROUND_TRIP_S else ""
    return Text(f"{1000 * line.round_trip_s:.1f} ms", style=style)


def _age(line: RosterLine) -> Text:
    if line.age_s < 0:
        return _NONE
    for unit, seconds, digits in (("h", 3600.0, 1), ("min", 60.0, 0), ("s", 1.0, 1)):
        if line.age_s >= seconds:
            return Text(f"{line.age_s / seconds:.{digits}f} {unit}", style="red")
    return Text(f"{1000 * line.age_s:.0f} ms", style="red" if line.age_s > OLD_S else "")


def _battery(line: RosterLine) -> Text:
    if line.battery == BATTERY_UNKNOWN:
        return _NONE
    left = "" if line.battery_left_s < 0 else f", {duration(line.battery_left_s)}"
    return Text(f"{line.battery} %{left}", style="bold red" if line.battery < LOW_BATTERY else "")


def duration(seconds: float) -> str:
    """For people, in the unit in which it is at least one and a half."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _corrected(line: RosterLine) -> Text:
    """How much drift of its heading was taken out."""
    return Text(f"{line.corrected:+.0f}°") if line.neutral else _NONE


def _signal(line: RosterLine) -> Text:
    """Strength of its Wi-Fi, when it was joined."""
    dbm = signal_dbm(line.flags)
    return _NONE if dbm is None else Text(f"{dbm} dBm", style="yellow" if dbm < WEAK_DBM else "")


def _calibration(line: RosterLine) -> Text:
    if line.age_s < 0:
        return _NONE
    levels = _levels(line.calibration)
    names = ("gyro", "accel", "mag") if line.flags & IS_NDOF else ("gyro", "accel")
    text = Text()
    for name in names:
        text.append(f"{name} {levels[name]} ", style="yellow" if levels[name] < 2 else "")
    text.rstrip()
    return text


class _Column(NamedTuple):
    heading: str
    cell: Callable[[RosterLine], Text]
    justify: Literal["left", "right"] = "left"


_NAME = _Column("name", lambda line: Text(line.name, style="bold"))
_SIGNAL = _Column("signal", _signal, "right")
_COLUMNS = (
    _Column("state", lambda line: Text(line.state, style=_COLOURS.get(line.state, ""))),
    _Column("rate", _rate, "right"),
    _Column("loss", _loss, "right"),
    _Column("round trip", _round_trip, "right"),
    _Column("age", _age, "right"),
    _Column("battery", _battery, "right"),
    _SIGNAL,
    _Column("calibration", _calibration),
    _Column("neutral", lambda line: Text(line.neutral, style=_NEUTRAL_COLOURS.get(line.neutral, ""))),
    _Column("heading", _corrected, "right"),
    _Column("firmware", lambda line: Text(line.firmware) if line.firmware else _NONE),
    _Column("id", lambda line: Text(line.device_id, style="dim")),
    _Column("way", lambda line: Text(line.way) if line.way else _NONE),
)
