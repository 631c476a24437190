"""Keys and orders: what each of them changes, and what is refused with a sentence."""

from __future__ import annotations

import pytest

from appliance.box.orders import Order
from appliance.projector.alignment import MOST_BRIGHT, Alignment
from appliance.projector.controls import Controls
from appliance.projector.corners import FARTHEST, WHOLE
from appliance.projector.keyboards import Key
from appliance.projector.keys import HELP, press
from appliance.show_control.command import FORMS

SIZE = (1000, 500)


@pytest.fixture
def saved() -> list[Alignment]:
    return []


@pytest.fixture
def controls(saved: list[Alignment]) -> Controls:
    return Controls(Alignment(), saved.append)


def strike(controls: Controls, *names: str, shift: bool = False) -> str:
    """Press keys one after the other; what the last one says."""
    message = ""
    for name in names:
        message = press(Key(name, shift), controls, SIZE)
    return message


def test_arrows_move_the_chosen_corner_by_pixels(controls: Controls, saved: list[Alignment]) -> None:
    strike(controls, "C", "3", "Left", "Up")
    strike(controls, "Right", "Down", "Down", shift=True)
    x, y = controls.alignment.corners[2]
    assert (x * SIZE[0], y * SIZE[1]) == pytest.approx((1000 - 1 + 10, 500 - 1 + 20))
    assert controls.alignment.corners[:2] == WHOLE[:2]
    assert saved[-1] == controls.alignment


def test_arrows_do_nothing_outside_of_corner_mode(controls: Controls, saved: list[Alignment]) -> None:
    assert strike(controls, "Left", "R", "1") == "" and not saved
    strike(controls, "C", "Escape", "Left")
    assert not saved and controls.corner is None


def test_tab_cycles_through_the_corners_and_the_grid_is_shown(controls: Controls) -> None:
    assert not controls.shows_grid
    strike(controls, "C")
    assert (controls.corner, controls.shows_grid) == (0, True)
    strike(controls, "Tab", "Tab", "Tab", "Tab", "Tab")
    assert controls.corner == 1
    strike(controls, "Tab", "Tab", shift=True)
    assert controls.corner == 3
    strike(controls, "Escape")
    assert not controls.shows_grid
    strike(controls, "G")
    assert controls.shows_grid


def test_a_corner_cannot_fold_the_picture(controls: Controls) -> None:
    controls.place(1, (0.55, 0.45))
    strike(controls, "C", "2")
    messages = [strike(controls, "Left", shift=True) for _ in range(20)]
    assert "fold" in messages[-1]
    assert 0.45 < controls.alignment.corners[1][0] < 0.47


def test_mirror_brightness_info_help_and_quit(controls: Controls) -> None:
    strike(controls, "M", "-", "-", "+", "I")
    assert controls.alignment.mirror and controls.shows_info
    assert controls.alignment.brightness == pytest.approx(0.95)
    assert strike(controls, "H") == HELP
    strike(controls, *["Keypad -"] * 50)
    assert controls.alignment.brightness == 0
    strike(controls, "F")
    assert controls.wants_fullscreen and not controls.is_over
    strike(controls, "Q")
    assert controls.is_over


def test_unknown_keys_do_nothing(controls: Controls, saved: list[Alignment]) -> None:
    assert strike(controls, "X", "F5", "", "Escape", "5") == "" and not saved


def test_reset_fills_the_display(controls: Controls) -> None:
    strike(controls, "C", "1", "Right", "R")
    assert controls.alignment.corners == WHOLE


def test_orders(controls: Controls) -> None:
    assert controls.carry_out(Order("corner", (2, 0.9, 0.1)))[0]
    assert controls.alignment.corners[1] == (0.9, 0.1)
    assert controls.carry_out(Order("corners", (0.1, 0.1, 0.8, 0.1, 0.8, 0.9, 0.1, 0.9)))[0]
    assert controls.alignment.corners[2] == (0.8, 0.9)
    assert controls.carry_out(Order("brightness", (0.4,))) == (True, "Brightness 40 %.")
    assert controls.carry_out(Order("mirror", (1,)))[0] and controls.alignment.mirror
    assert controls.carry_out(Order("grid", (1,)))[0] and controls.shows_grid
    assert controls.carry_out(Order("info", (1,)))[0] and controls.shows_info
    assert controls.carry_out(Order("corners/reset"))[0]
    assert controls.alignment.corners == WHOLE


def test_commands_can_do_what_keys_can() -> None:
    _, x, y = FORMS["/projector/corner"].numbers
    assert {x[1:3], y[1:3]} == {(-FARTHEST, 1 + FARTHEST)}
    assert FORMS["/projector/brightness"].numbers[0].most == MOST_BRIGHT


def test_a_nudge_says_where_the_corner_is_now(controls: Controls, saved: list[Alignment]) -> None:
    done, message = controls.carry_out(Order("nudge", (2, -0.125, 0.25)))
    assert (done, message) == (True, "The top right corner is at (0.8750, 0.2500).")
    assert controls.carry_out(Order("nudge", (2, 0.0625, 0.0)))[1].endswith("(0.9375, 0.2500).")
    assert saved[-1].corners[1] == (0.9375, 0.25)
    done, message = controls.carry_out(Order("nudge", (2, -1, 1)))
    assert not done and "fold" in message and message.endswith("(0.9375, 0.2500).")


@pytest.mark.parametrize(
    "order",
    [
        Order("corner", (5, 0.1, 0.1)),
        Order("corner", (1, 0.9, 0.9)),
        Order("corner", (1, float("nan"), 0.0)),
        Order("corner", (1,)),
        Order("nudge", (0, 0.1, 0.1)),
        Order("nudge", (1, 0.1)),
        Order("corners", (1, 0, 0, 0, 0, 1, 1, 1)),
        Order("brightness"),
        Order("dance", (1,)),
    ],
)
def test_refused_orders_change_nothing(controls: Controls, saved: list[Alignment], order: Order) -> None:
    done, message = controls.carry_out(order)
    assert not done and message.endswith(".") and not saved
    assert controls.alignment == Alignment()
