"""The roster: every sensor as the stage sees it, in the lines that show control tells."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from appliance.box.roster import UNKNOWN_S, RosterLine
from appliance.sensor.link import SensorState


def roster_lines(
    states: Sequence[SensorState],
    neutral_of: Callable[[str], str],
    corrected_of: Callable[[str], float] = lambda _: 0.0,
    battery_left_s: Callable[[str], float] = lambda _: UNKNOWN_S,
) -> list[RosterLine]:
    """A line for each. By a sensor's name: the state of its neutral pose, in one word; degrees of drift taken
    out of its heading; seconds that its battery lasts.
    """
    return [
        _line(state, neutral_of(state.name))._replace(
            corrected=corrected_of(state.name), battery_left_s=battery_left_s(state.name)
        )
        for state in states
    ]


def _line(state: SensorState, neutral: str) -> RosterLine:
    return RosterLine(
        name=state.name,
        device_id=f"{state.device_id:08x}",
        state=state.state,
        way=state.way,
        rate_hz=state.rate_hz,
        loss=state.loss,
        round_trip_s=_known(state.round_trip_s),
        age_s=_known(state.age_s),
        battery=state.battery,
        calibration=state.calibration,
        flags=state.flags,
        firmware=state.firmware,
        imu_id=state.imu_id,
        neutral=neutral,
        complaint=state.complaint,
    )


def _known(seconds: float | None) -> float:
    return UNKNOWN_S if seconds is None else seconds
