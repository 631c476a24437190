"""The report of the experiments: an HTML page that opens without a network, its pictures inside."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from appliance.pose.whole_file import write_text_whole
from appliance.studio.experiments.claims import Claim, times, verdict, worth
from appliance.studio.experiments.excerpts import Excerpt

_STYLE = """
body { background: #0f1015; color: #efe6d8; font: 16px/1.5 system-ui, sans-serif;
       margin: 2rem auto; max-width: 76rem; padding: 0 1.5rem }
h1, h2, h3 { font-weight: 500 } h1 { font-size: 1.7rem } h2 { margin-top: 3rem }
table { border-collapse: collapse; margin: 1rem 0; width: 100% }
th, td { border-bottom: 1px solid #34353d; padding: .35rem .6rem; text-align: right; vertical-align: top }
th:first-child, td:first-child { text-align: left } th { color: #9a948c; font-weight: 400 }
.yes { color: #8fc98f } .no { color: #f5462a } .measure { color: #9a948c }
img { width: 100%; margin: .5rem 0 1.5rem }
"""


def write_page(
    path: Path,
    title: str,
    text: Sequence[str],
    excerpts: Sequence[Excerpt],
    networks: Mapping[str, Sequence[Claim]],
    nulls: Mapping[str, Sequence[Claim]],
    pictures: Mapping[str, Sequence[Path]],
) -> None:
    """text: paragraphs below the title; networks, nulls: claims by name; pictures: PNG files by heading."""
    parts = [f"<h1>{html.escape(title)}</h1>", *(f"<p>{html.escape(one)}</p>" for one in text)]
    parts += ["<h2>The excerpts</h2>", _excerpts(excerpts), "<h2>The paper's claims</h2>"]
    parts += [_summary(networks, nulls), "<h3>Networks that know nothing</h3>", _nulls(nulls)]
    for name, claims in networks.items():
        parts += [f"<h3>{html.escape(name)}</h3>", *(_claim(one) for one in claims)]
    for heading, files in pictures.items():
        parts += [f"<h2>{html.escape(heading)}</h2>", *map(_picture, files)] if files else []
    write_text_whole(
        path,
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n",
    )


def _excerpts(excerpts: Sequence[Excerpt]) -> str:
    names = ("whole", "torso", "arms", "legs")
    rows = [["excerpt", "take", "seconds", *(f"{name}, degrees/s" for name in names), "coordination"]]
    for one in excerpts:
        seconds = one.as_json()["seconds"]
        assert isinstance(seconds, list), "two of them"
        speeds = [f"{getattr(one.measures, name):.0f}" for name in names]
        place = f"{seconds[0]:.1f} to {seconds[1]:.1f}"
        rows.append([f"{one.name}: {one.why}", one.take, place, *speeds, f"{one.measures.coordination:.2f}"])
    return _table(rows)


def _summary(networks: Mapping[str, Sequence[Claim]], nulls: Mapping[str, Sequence[Claim]]) -> str:
    rows = [["claim", "bounds", *networks, "null networks"]]
    for claims in zip(*networks.values(), strict=True):
        first, verdicts = claims[0], map(verdict, claims)
        rows.append([_title(first), _bounds(first), *verdicts, worth(first, nulls)])
    return _table(rows)


def _nulls(nulls: Mapping[str, Sequence[Claim]]) -> str:
    rows = zip(*nulls.values(), strict=True)
    return _table([["claim", *nulls], *([_title(row[0]), *map(verdict, row)] for row in rows)])


def _claim(claim: Claim) -> str:
    columns = list(next(iter(claim.figures.values()), {}))
    rows = [["excerpt", *(column.replace("_", " ") for column in columns), "margin", ""]]
    for name, figures in claim.figures.items():
        said = {True: "holds", False: "does not hold", None: ""}[claim.holds.get(name)]
        margin = times(claim.margins[name]) if name in claim.about else ""
        rows.append([name, *(f"{figures[column]:.2f}" for column in columns), margin, said])
    measure = html.escape(f"{claim.measure}. Holds with {_bounds(claim)}.")
    text = html.escape(_title(claim))
    return f"<p>{text}<br><span class=measure>{measure}</span></p>{_table(rows)}"


def _title(claim: Claim) -> str:
    return f"({claim.letter}) {claim.text}"


def _bounds(claim: Claim) -> str:
    return "; ".join(map(str, claim.bounds))


def _table(rows: Sequence[Sequence[str]]) -> str:
    head, *body = rows
    lines = ["<tr>" + "".join(f"<th>{html.escape(cell)}</th>" for cell in head) + "</tr>"]
    for row in body:
        cells = "".join(f"<td{_colour(cell)}>{html.escape(cell)}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    return f"<table>{''.join(lines)}</table>"


def _colour(cell: str) -> str:
    """Symbol of a verdict."""
    return " class=yes" if cell.startswith("holds") else " class=no" if cell.startswith("does not") else ""


def _picture(file: Path) -> str:
    """As JPEG: a tenth of the size, and thirty of them are on the page."""
    from PIL import Image

    packed = io.BytesIO()
    Image.open(file).convert("RGB").save(packed, "JPEG", quality=88)
    data = base64.b64encode(packed.getvalue()).decode()
    return f'<img alt="{html.escape(file.stem)}" src="data:image/jpeg;base64,{data}">'
