"""Draws how each board of the wearable is wired: docs/pictures/wiring-BOARD.svg.

`python -m tools.wiring_pictures` draws them anew; a test fails when one is stale.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "docs" / "pictures"
RED, BLACK, BLUE, GREEN, PURPLE, ORANGE = "#c0392b", "#222", "#2471a3", "#1e8449", "#8e44ad", "#d35400"


@dataclass(frozen=True)
class Wiring:
    """Pins of one board, as printed on it. tap: pin and two resistors of the battery tap, or None."""

    board: str
    supply: str
    ground: str
    data: str
    clock: str
    plus: str
    minus: str
    imu: str
    imu_notes: tuple[str, ...]
    tap: tuple[str, str, str] | None = None
    note: str = ""


BNO055 = ("BNO055 breakout", ("ADR, PS0, PS1 stay open",))
ANY = ("BNO085 or LSM6DSV", ("BNO085: PS0, PS1, INT, RST stay open", "LSM6DSV: CS to 3.3 V"))
MKR = ("VCC", "GND", "SDA, pin 11", "SCL, pin 12", "battery socket +", "\u2212")
WIRINGS = {
    "mkr1000": Wiring(
        "Arduino MKR1000", *MKR, *BNO055, ("A1", "100 k\u03a9", "330 k\u03a9"), "A3 stays open (noise)"
    ),
    "mkrwifi1010": Wiring("Arduino MKR WiFi 1010", *MKR, *BNO055, None, "A3 stays open (noise)"),
    "xiao_esp32s3": Wiring(
        "Seeed XIAO ESP32-S3",
        *("3V3", "GND", "SDA, D4", "SCL, D5", "pad BAT+", "pad BAT\u2212"),
        *ANY,
        ("A0", "220 k\u03a9", "220 k\u03a9"),
    ),
    "nano_esp32": Wiring(
        "Arduino Nano ESP32",
        *("3.3V", "GND", "SDA, A4", "SCL, A5", "VIN, by a charger with 5 V", "GND"),
        *ANY,
        ("A0", "220 k\u03a9", "220 k\u03a9"),
    ),
}


def drawing(wiring: Wiring) -> str:
    """The drawing as SVG."""
    pins = [(wiring.supply, "VIN", RED), (wiring.ground, "GND", BLACK)]
    pins += [(wiring.data, "SDA", BLUE), (wiring.clock, "SCL", GREEN)]
    parts = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 860 470" font-family="sans-serif">',
        '<rect width="860" height="470" fill="#fff"/>',
        _box(60, 60, 230, 270),
        _box(560, 60, 240, 205),
        _box(640, 310, 140, 110),
        _text(80, 88, wiring.board, weight="bold"),
        _text(580, 88, wiring.imu, weight="bold"),
        _text(676, 372, "LiPo cell", weight="bold"),
        _text(680, 394, "3.7 V", size=12),
    ]
    for row, (pin, imu_pin, colour) in enumerate(pins):
        y = 120 + 30 * row
        parts += [
            _line(f"M290 {y}H560", colour, 3),
            _text(278, y + 5, pin, anchor="end"),
            _text(572, y + 5, imu_pin),
        ]
    parts += [_text(380, 114, "3.3 V", size=12), _text(380, 144, "ground", size=12)]
    parts += [_text(572, 234 + 15 * row, note, size=11) for row, note in enumerate(wiring.imu_notes)]
    if wiring.note:
        parts.append(_text(72, 275, wiring.note, size=12))
    parts += _cell(wiring)
    if wiring.tap is not None:
        parts += _tap(*wiring.tap)
    return "\n  ".join([*parts, *_axes()]) + "\n</svg>\n"


def _cell(wiring: Wiring) -> list[str]:
    return [
        _text(278, 310, wiring.plus, anchor="end"),
        _text(278, 327, wiring.minus, anchor="end"),
        _line("M290 305H480", RED, 3),
        _line("M480 305L522 290", BLACK, 3),
        _line("M525 305H600V335H640", RED, 3),
        _line("M290 322H330V395H640", BLACK, 3),
        _dot(480, 305, BLACK),
        _dot(525, 305, BLACK),
        _text(483, 280, "switch", size=12),
        _text(648, 340, "+", size=12),
        _text(648, 400, "\u2212", size=12),
    ]


def _tap(pin: str, upper: str, lower: str) -> list[str]:
    return [
        _text(278, 255, pin, anchor="end"),
        _line("M290 250H400V256M400 292V305M360 250V330M360 370V395", PURPLE, 2),
        f'<path d="M390 256h20v36h-20zM350 330h20v40h-20z" fill="#fff" stroke="{PURPLE}" stroke-width="2"/>',
        _dot(360, 250, PURPLE),
        _dot(400, 305, BLACK),
        _dot(360, 395, BLACK),
        _text(416, 279, upper, size=12, colour=PURPLE),
        _text(376, 355, lower, size=12, colour=PURPLE),
        _text(376, 241, "battery tap, optional", size=12, colour=PURPLE),
    ]


def _axes() -> list[str]:
    """The IMU's axes in its case: x along the arrow, z away from the skin."""
    return [
        _line("M700 160H755M700 160V125", ORANGE, 3),
        f'<path d="M770 160l-16 -7v14zM700 110l-7 16h14z" fill="{ORANGE}"/>',
        f'<circle cx="700" cy="160" r="7" fill="#fff" stroke="{ORANGE}" stroke-width="2"/>',
        _dot(700, 160, ORANGE, 2),
        _text(784, 184, "x, the arrow", size=12, colour=ORANGE, anchor="end"),
        _text(712, 124, "y", size=12, colour=ORANGE),
        _text(660, 184, "z, up", size=12, colour=ORANGE),
    ]


def _box(x: int, y: int, width: int, height: int) -> str:
    place = f'x="{x}" y="{y}" width="{width}" height="{height}"'
    return f'<rect {place} rx="6" fill="none" stroke="{BLACK}" stroke-width="2"/>'


def _line(path: str, colour: str, width: int) -> str:
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _dot(x: int, y: int, colour: str, radius: int = 4) -> str:
    return f'<circle cx="{x}" cy="{y}" r="{radius}" fill="{colour}"/>'


def _text(
    x: int,
    y: int,
    text: str,
    size: int = 14,
    colour: str = BLACK,
    anchor: str = "start",
    weight: str = "normal",
) -> str:
    style = f'font-size="{size}" fill="{colour}" text-anchor="{anchor}" font-weight="{weight}"'
    return f'<text x="{x}" y="{y}" {style}>{escape(text)}</text>'


def main() -> None:
    for profile, wiring in WIRINGS.items():
        (FOLDER / f"wiring-{profile}.svg").write_text(drawing(wiring), encoding="utf-8")


if __name__ == "__main__":
    main()
