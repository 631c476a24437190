"""Sentences of the box that its page translates: `python -m tools.page_sentences` lists those without German.

The box speaks English. The page's words/sentences/LANGUAGE.json has its sentences as in the source, where
{0} and {1} stand for values that are filled in.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from appliance.show.box import BoxConfig
from appliance.show.venue_keys import venue_keys

ROOT = Path(__file__).resolve().parents[1]
SENTENCES = ROOT / "appliance/console/page/words/sentences"
_NOT_ON_THE_PAGE = ("fallback.py", "metrics.py", "report.py", "run.py")  # fallbacks: words/LANGUAGE.json
SPOKEN = (  # what a technician hears from the box on the page
    *sorted((ROOT / "appliance/cli/doctor").glob("*.py")),
    *(
        path
        for path in sorted((ROOT / "appliance/console").glob("*.py"))
        if path.name not in _NOT_ON_THE_PAGE
    ),
    *(
        ROOT / "appliance" / name
        for name in (
            "cli/box_file.py",
            "projector/controls.py",
            "show_control/command_handler.py",
            "show_control/order_dispatch.py",
            "show_control/show_state_commands.py",
            "stage/carry_out.py",
        )
    ),
)
_SENTENCE = re.compile(r"^[A-Z{`'].*\s.*[.?`)]$", re.DOTALL)
_LEAST_WORDS = 2


def templates() -> list[str]:
    """Each sentence once, in the order of the sources; those of the box file's form at the end."""
    found = dict.fromkeys(one for path in SPOKEN for one in _in(path.read_text()) if _is_sentence(one))
    keys = venue_keys(BoxConfig())
    return [
        *found,
        *dict.fromkeys(one.purpose for one in keys),
        *dict.fromkeys(one.within for one in keys if one.within),
    ]


def translated(language: str) -> dict[str, str]:
    """The table of a language."""
    table: dict[str, str] = json.loads((SENTENCES / f"{language}.json").read_text())
    return table


def _in(source: str) -> Iterator[str]:
    tree = ast.parse(source)
    docs = {id(node.body[0].value) for node in ast.walk(tree) if _has_docstring(node)}  # type: ignore[attr-defined]
    inside: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            inside |= {id(part) for part in ast.walk(node)}
            yield _template(node)
        elif isinstance(node, ast.Constant) and id(node) not in docs | inside and isinstance(node.value, str):
            yield node.value


def _has_docstring(node: ast.AST) -> bool:
    body = getattr(node, "body", None)
    first = body[0] if isinstance(body, list) and body else None
    return isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)


def _template(node: ast.JoinedStr) -> str:
    parts, place = [], 0
    for part in node.values:
        if isinstance(part, ast.Constant):
            parts.append(str(part.value))
        else:
            parts.append(f"{{{place}}}")
            place += 1
    return "".join(parts)


def _is_sentence(text: str) -> bool:
    plain = re.sub(r"\{\d+\}|`[^`]*`", "", text)  # a command is the same in each language
    return bool(_SENTENCE.match(text)) and len(re.findall(r"[A-Za-z]{2,}", plain)) >= _LEAST_WORDS


def main() -> int:
    """List what is not translated."""
    language = sys.argv[1] if len(sys.argv) > 1 else "de"
    missing = [one for one in templates() if one not in translated(language)]
    print(json.dumps(missing, indent=1, ensure_ascii=False))
    print(f"{len(missing)} of {len(templates())} are missing.", file=sys.stderr)
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main())
