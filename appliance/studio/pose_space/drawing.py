"""The line drawn over a map: an SVG made from map.svg, or a CSV of points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appliance.pose.foreign_file import opened
from appliance.pose.quaternion import Array
from appliance.studio.exchange.table_reading import separator_of
from appliance.studio.studio_error import StudioError

UNITS = 100.0  # units of map.svg for one unit of the map; its y points down
STEPS = 400  # points of a drawn curve
LARGEST = 5_000_000  # bytes


def read_line(file: Path) -> Array:
    """(N, 2) points of the map. Raises StudioError, or OSError."""
    opened(file).close()
    if file.stat().st_size > LARGEST:
        raise StudioError(f"{file} is larger than {LARGEST // 1_000_000} MB: that is no line.")
    points = _of_csv(file) if file.suffix.casefold() == ".csv" else _of_svg(file)
    if len(points) < 2 or np.ptp(points, axis=0).max() < 1e-6:
        raise StudioError(f"{file} has no line with a length. Draw one over map.svg, or write two points.")
    return points


def _of_csv(file: Path) -> Array:
    """Lines 'x, y', or 'x; y' with decimal commas; a first line of words and comments are left out."""
    points: list[tuple[float, float]] = []
    for number, line in enumerate(file.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1):
        mark = separator_of(line)
        cells = [cell.replace(",", ".") for cell in line.partition("#")[0].split(mark)]
        if not "".join(cells).strip():
            continue
        try:
            x, y = (float(cell) for cell in cells[:2])
        except ValueError:
            if not points and number == 1:
                continue
            raise StudioError(f"{file}:{number}: '{line.strip()[:60]}' is no point. Write: x, y") from None
        if not (np.isfinite(x) and np.isfinite(y)):
            raise StudioError(f"{file}:{number}: a point has finite numbers.")
        points.append((x, y))
    return np.array(points).reshape(-1, 2)


def _of_svg(file: Path) -> Array:
    """The longest path or line of the drawing, with all transformations around it."""
    try:
        from svgelements import SVG, Matrix, Shape
        from svgelements import Path as Curve
    except ImportError:
        raise StudioError(
            "Drawings need svgelements, which is not installed here: pip install bunraku-studio. Or write "
            "the line as a CSV of points."
        ) from None
    try:
        drawing = SVG.parse(str(file))
        to_drawing = ~Matrix(drawing.viewbox_transform)
        curves = [(Curve(one) * to_drawing).reify() for one in drawing.elements() if isinstance(one, Shape)]
    except Exception as error:  # svgelements and the XML parser raise many classes
        raise StudioError(f"{file} cannot be read as SVG ({str(error).splitlines()[0][:120]}).") from None
    curves = [curve for curve in curves if len(curve) > 1]
    if not curves:
        raise StudioError(f"{file} holds no line. Draw one with the pen over map.svg, and save it.")
    longest = max(curves, key=lambda curve: float(curve.length(error=1e-2)))
    points = np.array(
        [(point.x, point.y) for point in (longest.point(at) for at in np.linspace(0, 1, STEPS))]
    )
    return points * (1 / UNITS, -1 / UNITS)
