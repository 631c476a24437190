"""The keys of the projector's keyboard; their help goes to the terminal, never onto the wall."""

from __future__ import annotations

from appliance.projector.controls import Controls
from appliance.projector.keyboards import Key
from appliance.projector.window import Size

HELP = """\
c            corner mode: lay the picture onto the wall
1 2 3 4 Tab  choose a corner, clockwise from the top left
arrows       move it by a pixel, with Shift by ten
r            the picture fills the display again
Esc          end of corner mode
g            grid on or off
m            mirror, for rear projection
+ -          brighter, darker
i            figures on the wall on or off
t            test card in place of the dance, or the dance
f            fullscreen or window
q            end"""

_ARROWS = {"Left": (-1, 0), "Right": (1, 0), "Up": (0, -1), "Down": (0, 1)}
_BRIGHTER = ("+", "=", "Keypad +")
_DARKER = ("-", "Keypad -")
_STEP = 0.05


def press(key: Key, controls: Controls, size: Size) -> str:
    """Carry out a key; `size`: the display's, pixels. Returns a sentence for the terminal, maybe empty."""
    if key.name in _ARROWS:
        pixels = 10 if key.shift else 1
        dx, dy = _ARROWS[key.name]
        return controls.move(pixels * dx / size[0], pixels * dy / size[1])
    if key.name in _BRIGHTER or key.name in _DARKER:
        step = _STEP if key.name in _BRIGHTER else -_STEP
        return controls.set_brightness(controls.alignment.brightness + step)
    if controls.corner is not None:
        in_corner_mode = _corner_key(key, controls, controls.corner)
        if in_corner_mode:
            return in_corner_mode
    return _single_key(key.name, controls)


def _corner_key(key: Key, controls: Controls, corner: int) -> str:
    if key.name in ("1", "2", "3", "4"):
        return controls.choose(int(key.name) - 1)
    if key.name == "Tab":
        return controls.choose(corner + (-1 if key.shift else 1))
    if key.name == "R":
        return controls.reset()
    if key.name in ("Escape", "C"):
        return controls.leave_corners()
    return ""


def _single_key(name: str, controls: Controls) -> str:
    match name:
        case "C":
            return controls.enter_corners()
        case "G":
            return controls.set_grid(not controls.has_grid)
        case "M":
            return controls.set_mirror(not controls.alignment.mirror)
        case "I":
            return controls.set_info(not controls.shows_info)
        case "T":
            return controls.set_test_card(not controls.shows_test_card)
        case "H":
            return HELP
        case "F":
            controls.wants_fullscreen = True
        case "Q":
            controls.is_over = True
            return "The projector ends: you pressed q."
    return ""
