"""The cables of the cards that lead to the receivers: who is silent, and who takes over."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from appliance.pair.carrier import Carrier, cards_to, receivers_of
from appliance.show.box import OutputsConfig

NEVER = float("-inf")


@pytest.fixture
def routes(tmp_path: Path) -> Path:
    path = tmp_path / "route"
    write_routes(path, ("eth1", "00000000", "00000000"), ("eth0", "00004D0A", "00FFFFFF"))
    return path


def write_routes(path: Path, *rows: tuple[str, str, str]) -> None:
    lines = ["\t".join([name, network, *"00000", mask, "0"]) for name, network, mask in rows]
    path.write_text("\n".join(["Iface\tDestination", *lines]) + "\n")


def plugged(folder: Path, card: str, text: str) -> None:
    (folder / card).mkdir(exist_ok=True)
    (folder / card / "carrier").write_text(f"{text}\n")


def test_the_card_to_an_address_is_that_of_the_narrowest_network(routes: Path, tmp_path: Path) -> None:
    assert cards_to(["10.77.0.2"], routes) == ["eth0"] and cards_to(["10.78.0.2"], routes) == ["eth1"]
    assert cards_to(["10.77.0.2", "10.77.0.3"], routes) == ["eth0"]
    assert cards_to(["10.77.0.2"], tmp_path / "none") == []


def test_receivers_are_reached_by_their_address_or_by_the_boxs_own() -> None:
    outputs = OutputsConfig.model_validate(
        {
            "osc": [{"host": "10.77.0.9"}],
            "posistagenet": [{"interface": "10.77.0.1"}],
            "dmx": [
                {"wire": "sacn", "universe": 1, "interface": "10.0.0.1"},
                {"wire": "artnet", "universe": 2, "host": "10.0.0.7"},
                {"wire": "udmx", "universe": 3},
            ],
        }
    )
    assert [*receivers_of(outputs)] == ["10.77.0.9", "10.77.0.1", "10.0.0.1", "10.0.0.7"]


def test_a_leader_whose_cable_comes_back_listens_first(routes: Path, tmp_path: Path) -> None:
    plugged(tmp_path, "eth0", "1")
    carrier = Carrier(["10.77.0.9"], routes, tmp_path)
    carrier.look(1.0)
    assert carrier.is_up and carrier.may_speak(1.0, NEVER) and carrier.knows_silence(1.0, NEVER)
    plugged(tmp_path, "eth0", "0")
    carrier.look(2.0)
    assert carrier.is_out and not carrier.may_speak(2.0, 2.0) and not carrier.knows_silence(2.0, 2.0)
    assert not carrier.is_heard_nonetheless(2.1, 2.0, {}) and carrier.is_heard_nonetheless(2.1, 2.01, {})
    plugged(tmp_path, "eth0", "1")
    carrier.look(3.0)
    assert not carrier.may_speak(34.0, 1.9) and carrier.may_speak(3.05, 3.01) and carrier.may_speak(35.1, 1.9)


@pytest.mark.parametrize("heard", [NEVER, 0.5])
def test_a_leader_that_was_alone_before_its_cable_was_out_speaks_soon_after_it_came_back(
    routes: Path, tmp_path: Path, heard: float
) -> None:
    carrier = Carrier(["10.77.0.9"], routes, tmp_path)
    for now, text in ((1.0, "1"), (2.0, "0"), (3.0, "1")):
        plugged(tmp_path, "eth0", text)
        carrier.look(now)
    assert not carrier.may_speak(3.05, heard) and carrier.may_speak(3.1, heard)


def test_a_leader_whose_cable_is_out_knows_at_once_that_another_link_is_whole(
    routes: Path, tmp_path: Path
) -> None:
    plugged(tmp_path, "eth0", "1")
    switched, direct = "10.77.0.2", "192.168.1.5"
    carrier = Carrier(["10.77.0.9"], routes, tmp_path, [switched, direct])
    carrier.look(1.0)
    assert not carrier.is_heard_nonetheless(1.0, 1.0, {direct: 1.0})
    plugged(tmp_path, "eth0", "0")
    carrier.look(2.0)
    assert carrier.is_heard_nonetheless(2.0, 1.99, {direct: 1.99})
    assert not carrier.is_heard_nonetheless(2.0, 1.99, {switched: 1.99, direct: 1.8})
    assert not carrier.is_heard_nonetheless(2.0, 1.99, {"10.78.0.7": 1.99})


def test_a_follower_whose_cable_comes_back_leaves_a_switch_time_to_forward(
    routes: Path, tmp_path: Path
) -> None:
    plugged(tmp_path, "eth0", "0")
    carrier = Carrier(["10.77.0.9"], routes, tmp_path)
    carrier.look(1.0)
    plugged(tmp_path, "eth0", "1")
    carrier.look(2.0)
    assert not carrier.knows_silence(20.0, 0.5) and carrier.knows_silence(20.0, 19.9)
    assert carrier.knows_silence(40.0, 0.5)


def test_an_adapter_of_another_name_takes_the_place_of_the_one_that_was_unplugged(
    routes: Path, tmp_path: Path
) -> None:
    """Null: any card that seems to lead there; the kernel sends by the default route meanwhile."""
    default = ("eth1", "00000000", "00000000")
    plugged(tmp_path, "eth0", "1")
    plugged(tmp_path, "eth1", "1")
    carrier = Carrier(["10.77.0.9"], routes, tmp_path)
    carrier.look(1.0)
    assert carrier.is_up
    shutil.rmtree(tmp_path / "eth0")
    write_routes(routes, default)
    carrier.look(2.0)
    carrier.look(3.0)
    assert carrier.is_out
    plugged(tmp_path, "enx1", "1")
    write_routes(routes, default, ("enx1", "00004D0A", "00FFFFFF"))
    carrier.look(4.0)
    assert carrier.is_up and not carrier.is_out and not carrier.may_speak(4.0, 2.0)


def test_one_of_two_cables_is_enough(routes: Path, tmp_path: Path) -> None:
    plugged(tmp_path, "eth0", "0")
    plugged(tmp_path, "eth1", "1")
    carrier = Carrier(["10.77.0.9", "192.168.1.5"], routes, tmp_path)
    carrier.look(1.0)
    assert carrier.is_up and not carrier.is_out


def test_a_box_without_a_network_is_never_out(tmp_path: Path) -> None:
    carrier = Carrier(["127.0.0.1"], tmp_path / "none", tmp_path)
    carrier.look(1.0)
    assert carrier.is_up and not carrier.is_out
    unknown = Carrier(["10.77.0.9"], tmp_path / "none", tmp_path)
    unknown.look(1.0)
    assert not unknown.is_up and not unknown.is_out and unknown.may_speak(1.0, NEVER)


def test_a_pair_whose_link_takes_another_way_than_the_outputs_is_known(routes: Path, tmp_path: Path) -> None:
    carrier = Carrier(["10.77.0.9"], routes, tmp_path)
    assert carrier.is_apart(["192.168.1.5"]) and not carrier.is_apart(["192.168.1.5", "10.77.0.2"])
    assert not Carrier(["127.0.0.1"], routes, tmp_path).is_apart(["10.77.0.2"])
