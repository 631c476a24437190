"""A stick that is plugged in while the box is on: right after power-on, and in the middle of the show."""

from __future__ import annotations

from appliance.cli.preflight import ANEW
from appliance.release.choice import EMBEDDED_SHOW
from tests.system.box_folders import Machine, late


def test_a_stick_right_after_power_on_dances_at_once(machine: Machine) -> None:
    machine.preflight()
    machine.bring("Spring")
    assert "dances at once" in " ".join(late(machine, uptime_s=20.0))
    assert machine.dances == "Spring"
    assert (machine.run / ANEW).exists()


def test_a_stick_in_the_middle_of_the_show_waits_for_the_next_power_on(machine: Machine) -> None:
    machine.preflight()
    machine.bring("Spring")
    assert "after the next power-on" in " ".join(late(machine, uptime_s=3600.0))
    assert machine.choice.first.show == EMBEDDED_SHOW
    assert not (machine.run / ANEW).exists()
    machine.preflight()
    assert machine.dances == "Spring"


def test_a_broken_stick_in_the_middle_of_the_show_is_reported(machine: Machine) -> None:
    machine.preflight()
    show = machine.bring("Spring")
    (show / "puppet.onnx").unlink()
    late(machine, uptime_s=3600.0)
    assert "puppet.onnx" in " ".join(machine.choice.refused)
    assert machine.choice.first.show == EMBEDDED_SHOW
