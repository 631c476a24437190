"""The doctor's lines about this show's sensors, receivers and wires: each by name, a lost one is wrong."""

from __future__ import annotations

from typing import Any

import pytest

from appliance.box.process_health import Member
from appliance.cli.doctor import show_parts
from appliance.cli.doctor.finding import for_phone
from appliance.cli.doctor.host_view import HostView, RunningStage
from appliance.show.box import BoxConfig
from appliance.show_control.sensor_roster import RosterLine
from appliance.stage.sensor_lines import roster_lines
from tests.cli.running_box import LEFT, LOST, SPARE
from tests.system.machine_of_files import only, verdicts


def dancing(**health: Any) -> HostView:
    return HostView(stage=RunningStage(1, health))


def roster(**neutral: str) -> list[RosterLine]:
    return roster_lines([LEFT, LOST, SPARE], lambda name: neutral.get(name.replace("-", "_"), ""))


def test_each_sensor_of_the_show_has_a_line_and_a_spare_none() -> None:
    found = list(show_parts.sensors(dancing(sensors=roster(left_wrist="taken", head="kept"))))
    assert verdicts(found) == [("sensor left-wrist", "better"), ("sensor head", "wrong")]
    assert "50 readings a second; 1.2 % are lost; its battery is at 12 %" in found[0].message
    assert "lost, last heard 3 min ago: its joint moves freely" in found[1].message
    assert "bunraku sensors replace head SPARE" in found[1].cure


@pytest.mark.parametrize("state", ["absent", "greeted", "lost"])
def test_a_sensor_that_does_not_send_is_wrong(state: str) -> None:
    lines = roster_lines([LEFT._replace(state=state)], lambda _: "taken")
    assert only(show_parts.sensors(dancing(sensors=lines))).verdict == "wrong"


def test_a_sensor_without_a_key_is_wrong() -> None:
    found = only(show_parts.sensors(dancing(sensors=[], not_let_in=["right-ankle"])))
    assert (found.what, found.verdict) == ("sensor right-ankle", "wrong")
    assert "bunraku provision --name right-ankle" in found.cure


def test_each_receiver_has_a_line_and_a_dead_one_is_wrong() -> None:
    gone = {"name": "10.0.0.9:9000 (joint)", "gone": True, "error": "that machine does not answer"}
    here = {"name": "10.0.0.8:9000 (joint)", "gone": False, "error": "", "asked_for": True}
    usual = {"name": "127.0.0.1:9000 (joint)", "gone": False, "error": "refused", "asked_for": False}
    found = list(show_parts.receivers(dancing(receivers=[gone, here, usual])))
    assert [one.verdict for one in found] == ["wrong", "ok", "ok"]
    assert found[0].what == "receiver 10.0.0.9:9000 (joint)"
    assert "that machine does not answer" in found[0].message


def test_each_wire_has_a_line_and_no_light_at_all_is_wrong() -> None:
    wired = BoxConfig.model_validate(
        {"outputs": {"dmx": [{"universe": 1, "wire": "artnet", "host": "10.0.0.7"}]}}, context={}
    )
    away, here = "Art-Net 10.0.0.7, universe 1", "sACN, universe 2"
    parts = {away: f"{away}: no network leads there. Its lights do not follow.", here: ""}
    lights = Member("lights", 1, False, (), parts)
    found = list(show_parts.wires(HostView(box=wired, stage=RunningStage(1, {}, (), (lights,)))))
    assert verdicts(found) == [(away, "wrong"), (here, "ok")]
    assert found[0].message == "no network leads there. Its lights do not follow."
    for members in ((), (lights._replace(late=True),)):
        found = list(show_parts.wires(HostView(box=wired, stage=RunningStage(1, {}, (), members))))
        assert verdicts(found) == [("lights", "wrong")]


def test_nothing_is_said_of_a_show_that_does_not_dance() -> None:
    for check in (show_parts.sensors, show_parts.receivers, show_parts.wires):
        assert list(check(HostView())) == []


def test_someone_with_a_phone_gets_no_path_of_a_file() -> None:
    said = "There is no key file /data/bunraku/keys/sensors.keys. `sudo ls /etc/fstab`, or 10.0.0.1:9000/udp."
    kept = "There is no key file sensors.keys. `sudo ls /etc/fstab`, or 10.0.0.1:9000/udp."
    assert for_phone(said) == kept
    assert for_phone("sensor on /dev/ttyACM0") == "sensor on ttyACM0"
    assert for_phone("Give /data a partition.") == "Give /data a partition."
