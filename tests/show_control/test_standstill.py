"""Who starts and stops the phrase: the stopped show, until somebody does it by hand."""

from __future__ import annotations

from typing import Any

from appliance.box.show_state import ShowState
from appliance.show_control.order_dispatch import Then
from appliance.show_control.orders import Order
from appliance.show_control.standstill import Standstill

NOW = 1000.0


class Sight:
    """A stage as show control sees it, always the same one."""

    generation = 1

    def health(self) -> dict[str, Any]:
        return {"state": "stopped"}

    def state(self, now: float) -> str:
        return "stopped"


class OrderDispatch:
    """Orders that were given, and nobody answers."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.thens: list[Then] = []

    def begin(self, place: str, order: Order, now: float, then: Then, first: bool = False) -> None:
        assert first  # before all that wait
        self.names.append(order.name)
        self.thens.append(then)


def test_a_start_that_nobody_answered_is_given_again_until_it_is_done() -> None:
    errands = OrderDispatch()
    standstill = Standstill(Sight(), errands)  # type: ignore[arg-type]
    standstill.go(ShowState(), NOW)
    standstill.look(ShowState(), NOW + 1.1)
    assert errands.names == ["start", "start"]
    errands.thens[-1](True, "")
    standstill.look(ShowState(), NOW + 3.0)
    assert errands.names == ["start", "start"]


def test_what_somebody_does_by_hand_since_is_not_overruled() -> None:
    errands = OrderDispatch()
    standstill = Standstill(Sight(), errands)  # type: ignore[arg-type]
    standstill.look(ShowState(), NOW)
    standstill.go(ShowState(), NOW)
    standstill.leave()
    standstill.look(ShowState(), NOW + 1.1)
    assert errands.names == ["start"]
    standstill.look(ShowState(going=False, going_since=NOW), NOW + 9.0)
    assert errands.names == ["start", "stop"]  # the show as a whole is stopped all the same
