"""A technician's controls at the projector: corners, mirror, brightness, grid, information."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from appliance.box.orders import Order
from appliance.projector.alignment import MOST_BRIGHT, Alignment
from appliance.projector.corners import WHOLE, Corners, Point, complaint
from appliance.projector.warp import NOT_WARPED, moved
from appliance.projector.warp import complaint as warp_complaint
from appliance.show.projector import LEAST_TO_MOST_GAMMA, LEAST_TO_MOST_OVERLAP

_CORNER_NAMES = ("top left", "top right", "bottom right", "bottom left")


class Controls:
    """The state behind keys and orders. Each change returns a sentence about it.

    `keep` receives each new alignment. corner: the one that keys move in corner mode, 0 to 3, else None.
    """

    def __init__(
        self, alignment: Alignment, keep: Callable[[Alignment], None], shows_info: bool = False
    ) -> None:
        self.alignment = alignment
        self._keep = keep
        self.corner: int | None = None
        self._chosen = 0
        self.has_grid = False
        self.shows_info = shows_info
        self.shows_test_card = False
        self.is_over = False
        self.wants_fullscreen = False  # the owner of the window toggles it and resets this

    @property
    def shows_grid(self) -> bool:
        """Whether the grid lies over the picture: on demand, and always in corner mode."""
        return self.has_grid or self.corner is not None

    def enter_corners(self) -> str:
        """Corner mode, with the corner that was chosen last."""
        self.corner = self._chosen
        return f"Corner mode: arrows move the {_CORNER_NAMES[self._chosen]} corner, 1 to 4 choose, Esc ends."

    def choose(self, corner: int) -> str:
        """Another corner, 0 to 3 clockwise from the top left; enters corner mode."""
        self._chosen = corner % 4
        return self.enter_corners()

    def leave_corners(self) -> str:
        """End of corner mode."""
        self.corner = None
        return "Corner mode is over; the alignment is kept."

    def move(self, dx: float, dy: float) -> str:
        """Move the chosen corner by shares of the display's width and height."""
        if self.corner is None:
            return ""
        x, y = self.alignment.corners[self.corner]
        return self.place(self.corner, (x + dx, y + dy))[1]

    def nudge(self, corner: int, dx: float, dy: float) -> tuple[bool, str]:
        """Move one corner, 0 to 3; whether it was done, and where it is now."""
        x, y = self.alignment.corners[corner]
        done, message = self.place(corner, (x + dx, y + dy))
        x, y = self.alignment.corners[corner]
        here = f"The {_CORNER_NAMES[corner]} corner is at ({x:.4f}, {y:.4f})."
        return done, here if done else f"{message} {here}"

    def place(self, corner: int, point: Point) -> tuple[bool, str]:
        """Put one corner there, 0 to 3; whether it was done, and a sentence."""
        corners = list(self.alignment.corners)
        corners[corner] = point
        a, b, c, d = corners
        return self.place_all((a, b, c, d))

    def place_all(self, corners: Corners) -> tuple[bool, str]:
        """Put all four corners; whether it was done, and a sentence."""
        refused = complaint(corners) or warp_complaint(self.alignment.warp, corners)
        if refused:
            return False, refused
        self._set_alignment(replace(self.alignment, corners=corners))
        places = ", ".join(f"({x:.4f}, {y:.4f})" for x, y in corners)
        return True, f"The picture's corners are at {places}."

    def pull(self, point: int, dx: float, dy: float) -> tuple[bool, str]:
        """Pull a point of the mesh, 0 to 24 row by row, by shares of the display; whether it was done."""
        try:
            warp = moved(self.alignment.warp, point, (dx, dy))
        except ValueError as error:
            return False, str(error)
        if refused := warp_complaint(warp, self.alignment.corners):
            return False, refused
        self._set_alignment(replace(self.alignment, warp=warp))
        x, y = warp[point]
        return True, f"Point {point + 1} of the mesh is pulled by ({x:.4f}, {y:.4f})."

    def flatten(self) -> str:
        """No mesh warp any more; the corners stay."""
        self._set_alignment(replace(self.alignment, warp=NOT_WARPED))
        return "The picture is flat again between its corners."

    def reset(self) -> str:
        """The picture fills the display again."""
        self._set_alignment(replace(self.alignment, corners=WHOLE, warp=NOT_WARPED))
        return "The picture fills the display."

    def set_mirror(self, mirror: bool) -> str:
        """For rear projection or not."""
        self._set_alignment(replace(self.alignment, mirror=mirror))
        return "The picture is mirrored." if mirror else "The picture is not mirrored."

    def set_brightness(self, brightness: float) -> str:
        """A factor, limited to 0 and MOST_BRIGHT."""
        brightness = _within(brightness, (0.0, MOST_BRIGHT))
        self._set_alignment(replace(self.alignment, brightness=brightness))
        return f"Brightness {100 * brightness:.0f} %."

    def blend(self, name: str, value: float) -> tuple[bool, str]:
        """Set `overlap` or `blend_gamma`, limited as in the box file; whether it was done."""
        if not self.alignment.overlap:
            return False, (
                "This projector shows the whole picture. Nothing has changed. For two of them give each box "
                "file its `edge_blend` under `projector`."
            )
        overlap, gamma = self.alignment.overlap, self.alignment.blend_gamma
        if name == "overlap":
            overlap = _within(value, LEAST_TO_MOST_OVERLAP)
        else:
            gamma = _within(value, LEAST_TO_MOST_GAMMA)
        self._set_alignment(replace(self.alignment, overlap=overlap, blend_gamma=gamma))
        return True, f"The pictures overlap by {100 * overlap:.1f} %, blended with a gamma of {gamma:g}."

    def set_grid(self, grid: bool) -> str:
        """Show or hide the grid."""
        self.has_grid = grid
        return "The grid is on the wall." if grid else "The grid is off."

    def set_info(self, info: bool) -> str:
        """Show or hide the figures."""
        self.shows_info = info
        return "Figures are on the wall." if info else "No figures on the wall."

    def set_test_card(self, shown: bool) -> str:
        """Show the test card in place of the dance, or the dance."""
        self.shows_test_card = shown
        return "The test card is on the wall in place of the dance." if shown else "The dance is on the wall."

    def report(self) -> dict[str, Any]:
        """For the page: corners in shares of the display, brightness as a factor, grid and figures."""
        corners, brightness = self.alignment.corners, self.alignment.brightness
        return {
            "corners": corners,
            "warp": self.alignment.warp,
            "brightness": brightness,
            "overlap": self.alignment.overlap,
            "blend_gamma": self.alignment.blend_gamma,
            "grid": self.has_grid,
            "info": self.shows_info,
            "test_card": self.shows_test_card,
        }

    def carry_out(self, order: Order) -> tuple[bool, str]:
        """An order by OSC: whether it was done, and a sentence."""
        values = order.values
        match order.name, len(values):
            case "corner", 3 if values[0] in (1, 2, 3, 4):
                return self.place(int(values[0]) - 1, (values[1], values[2]))
            case "nudge", 3 if values[0] in (1, 2, 3, 4):
                return self.nudge(int(values[0]) - 1, values[1], values[2])
            case "corners", 8:
                a, b, c, d = ((values[k], values[k + 1]) for k in range(0, 8, 2))
                return self.place_all((a, b, c, d))
            case "warp", 3 if values[0] % 1 == 0:
                return self.pull(int(values[0]) - 1, values[1], values[2])
            case "warp/reset", _:
                return True, self.flatten()
            case "corners/reset", _:
                return True, self.reset()
            case "brightness", 1:
                return True, self.set_brightness(values[0])
            case "overlap" | "blend_gamma", 1:
                return self.blend(order.name, values[0])
            case "mirror", 1:
                return True, self.set_mirror(values[0] != 0)
            case "grid", 1:
                return True, self.set_grid(values[0] != 0)
            case "test_card", 1:
                return True, self.set_test_card(values[0] != 0)
            case "info", 1:
                return True, self.set_info(values[0] != 0)
        return False, f"The projector knows no order '{order.name}' with these values. Nothing has changed."

    def _set_alignment(self, alignment: Alignment) -> None:
        self.alignment = alignment
        self._keep(alignment)


def _within(value: float, least_to_most: tuple[float, float]) -> float:
    least, most = least_to_most
    return round(min(max(value, least), most), 4)
