"""Which sensors the show wears: no command takes one away from it unasked."""

from __future__ import annotations

from collections.abc import Mapping

from appliance.box.roster import Roster
from appliance.cli.doctor.host_view import running_stage
from appliance.cli.sensors.box_keys import BoxKeys
from appliance.release import choice
from appliance.release.choice import Choice
from appliance.sensor.keys import KeyFileError, load_keys
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.stage.stage_error import StageError

ANYWAY = "--anyway"
_NOT_RUNNING = "the box does not run now"


def worn_sensors(box_keys: BoxKeys) -> Mapping[str, str] | None:
    """Names of the sensors of this box's show and each one's state; None where no show is known.

    As the running stage sees them; where none runs or it is starting, the show chosen at power-on counts.
    """
    stage = running_stage(box_keys.box)
    lines = Roster.reported(stage.health).lines if stage is not None else []
    if not lines:
        return _worn_in_chosen_show(box_keys)
    return {line.name: line.state for line in lines if line.neutral}


def refuse_worn(box_keys: BoxKeys, name: str, loss: str, anyway: bool) -> None:
    """Raises StageError for a sensor of the show, unless `anyway`. loss: what the show loses, a clause."""
    if anyway:
        return
    worn = worn_sensors(box_keys)
    if worn is None:
        print(f"No box runs here that could say whether its show wears {name}.")
    elif name in worn:
        raise StageError(
            f"{name} is a sensor of this show ({worn[name]}): {loss}, and the dancer moves freely there. "
            f"Nothing was changed. {_spares(box_keys, worn)} "
            f"To do it all the same, give the command again with {ANYWAY}."
        )


def spares(box_keys: BoxKeys) -> str:
    """Which sensors of the key file the show does not wear, a sentence; "" where no show is known."""
    worn = worn_sensors(box_keys)
    return "" if worn is None else _spares(box_keys, worn)


def _spares(box_keys: BoxKeys, worn: Mapping[str, str]) -> str:
    try:
        found = [name for name in load_keys(box_keys.keys) if name not in worn]
    except (KeyFileError, OSError):  # the change itself reports it
        return ""
    return f"Spares: {', '.join(found)}." if found else "There is no spare: every sensor is in the show."


def _worn_in_chosen_show(box_keys: BoxKeys) -> Mapping[str, str] | None:
    try:
        chosen = Choice.read(choice.RUN / choice.CHOSEN)
        if chosen is None or chosen.first.box != box_keys.box.path:
            return None
        show = load_show(chosen.first.show)
    except (ConfigError, OSError):
        return None
    return {hand.sensor: _NOT_RUNNING for _, hand in show.config.hands_at if hand.sensor}
