"""Finds translated English in what people read: pages, messages, docstrings and comments.

`python -m tools.english` lists the findings; tests/test_english.py asserts that there are none.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("appliance", "hw_sim", "firmware", "tools", "deploy")
PAGES = ("*.md", "docs/*.md", "firmware/*.md")
C_LIKE = {".h", ".hpp", ".c", ".cpp", ".ino", ".js", ".glsl", ".css"}
WORDS = "appliance/console/page/words/en.json"
SCRIPTS = {".sh", ".service", ".conf", ".target", ".path", ".mount", ".rules", ".cmake", ".yaml"}

Kind = Literal["page", "message", "docstring", "comment"]
WORDS_AT_MOST: dict[Kind, int] = {"page": 40, "message": 30, "docstring": 40, "comment": 40}

_UNITS = r"(?:ms|s|seconds?|minutes?|hours?|ticks?|frames?|pictures?|metres?|degrees|km|m)"
_VERBS = (
    r"(?:is|are|was|were|has|have|had|would|could|cannot|can|may|must|needs?|does|do|did|will|should"
    r"|costs?|takes?)"
)
_PRONOUNS = r"(?:it|they|he|she|there|nobody|nothing|we|neither|both|only|then|here|these|those|such)"
_PROGRAMS = (
    r"(?:process|socket|program|server|box|thread|sensor|stage|projector|page|reader|writer|disk|sender|receiver"
    r"|peer|desk|client|widget|host|unit|command line|companion)(?:e?s)?"
)
_SOLID = r"(?:floor|ground|tables?|stage|legs?|foot|feet|one leg|wall|shelf|(?:T-|neutral )pose|hemisphere)"

PATTERNS: dict[str, re.Pattern[str]] = {
    "what": re.compile(r"^(?:And |But )?What(?:ever)? (?!if\b)(?!\w+$)[^?]*$"),
    "of": re.compile(r"^(?:of |Of (?!course\b|\d|those\b|these\b))[^?]*$"),
    "alone": re.compile(
        r"^(?!.*\b(?:[Ll]et|[Ll]eft|[Ll]eaves?)\b.* alone).*(?<=[a-z0-9`)] )(?<!stand )(?<!stands )"
        r"(?<!is )(?<!are )(?<!was )(?<!and )(?<!dances )(?<!dance )(?<!works )(?<!work )(?<!be )(?<!goes )"
        r"(?<!go )(?<!runs )(?<!run )(?<!one )\balone\b(?! in\b)"
    ),
    "each": re.compile(
        rf"\b[Ee]ach (?:\d[\d.,]*|half a|two|three|four|five|ten|few|hundred) ?{_UNITS}\b(?! (?:step|slot)\b)"
    ),
    "stands": re.compile(
        r"\b(?:stands?|stood|lies|lie) "
        r"(?:in|on|under|at|beside|above|below|there|here|before|behind|between)\b"
        rf"(?! (?:for|line)\b)(?! (?:the |a |an |its |one |your )?{_SOLID}\b)(?! \d)"
    ),
    "own": re.compile(r"\bof (?:its|their) own\b(?! accord)"),
    "want": re.compile(r"\bfor (?:the )?want of\b"),
    "for": re.compile(
        rf"[,;:] for {_PRONOUNS} (?!that\b|which\b|who\b)\w+(?<!\bwho)"
        r"|[,;:] for (?:the|a|an|its|no|two|their|each|one|some|most|all)"
        rf"(?: (?!that|which|who|where|when|to)\w+){{1,4}} {_VERBS}\b"
    ),
    "who": re.compile(rf"\b[Ww]hoever\b|\b{_PROGRAMS},? who\b|^Who (?!is\b|are\b)[^?]*$"),
    "none": re.compile(r"\b(?<![Tt]here )(?:is|are|be) none\b(?! of\b| the\b)"),
    "inversion": re.compile(
        r"^(?:Kept|Left out|Left|Missing|Lost|Held|Told|Counted|Written|Drawn|Made|Meant|Wanted|Needed|Asked"
        r"|Taken|Sent|Said|Shown|Found|Set|Read|Gone|New|Good|Open) (?:is|are)\b[^?]*$"
    ),
    "of it": re.compile(
        r"\b(?:known|noted|said|told|heard) of (?:it|them|each|what|a|the)\b(?! (?:clock|hour|half)\b)"
    ),
    "whose": re.compile(r"\b(?:in|of|by|with|from|at|to|on) whose\b"),
    "to be": re.compile(
        r"\b(?:is|are) to be (?:\w+(?:ed|en|nt|ne|ad|ught)|heard|held|told|said|put|set|kept|known)\b"
    ),
    "tells": re.compile(
        r"\btells (?:what|how|where|which|why|whether|that|the (?:same|options|rest|truth))\b"
    ),
}


@dataclass(frozen=True)
class Text:
    """A piece of text that people read: a paragraph, a cell of a table, a docstring, a comment, a message."""

    line: int
    kind: Kind
    text: str


@dataclass(frozen=True)
class Finding:
    """One sentence that reads like a translation."""

    path: str
    line: int
    kind: Kind
    tic: str
    sentence: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.kind}, '{self.tic}': {self.sentence}"


def tics_in(text: str, kind: Kind = "docstring") -> list[tuple[str, str]]:
    """Each tic in a text, with its sentence."""
    return [
        (tic, sentence)
        for sentence in sentences(text)
        for tic in (
            *(name for name, pattern in PATTERNS.items() if pattern.search(sentence)),
            *(["long"] if longest_part(sentence) > WORDS_AT_MOST[kind] else []),
        )
    ]


def longest_part(sentence: str) -> int:
    """Words of the longest part between semicolons and colons."""
    return max(len(re.findall(r"[\w'-]+", part)) for part in re.split("[;:]", sentence))


def sentences(text: str) -> Iterator[str]:
    """Sentences of a text in one line each, a code span and a link's target as one word."""
    text = re.sub(r"``?[^`]+``?", "`x`", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"\*\*|__", "", text)
    # a line with columns (a key, spaces, its meaning) is a row of a table
    for paragraph in re.split(r"\n\s*\n|\n\s*(?:[-*|]|\d+\.) |\n(?=.*\S {2,}\S)", text):
        joined = " ".join(paragraph.split())
        for sentence in re.split(r"(?<=[.!?])[)'\"]* +(?=[A-Z`'(\"*\d])", joined):
            if len(sentence.split()) > 1:
                yield sentence.lstrip("-#( '\"")


def texts_of_page(source: str) -> Iterator[Text]:
    """Paragraphs, items and cells of a Markdown page; neither code nor headings."""
    fenced, start, gathered = False, 0, list[str]()
    for number, line in enumerate([*source.splitlines(), ""], 1):
        bare = line.strip()
        ends = not bare or bare.startswith(("```", "#", "|", "- ", "* ")) or re.match(r"\d+\. ", bare)
        if ends and gathered:
            yield Text(start, "page", " ".join(gathered))
            gathered = []
        if bare.startswith("```"):
            fenced = not fenced
        elif bare.startswith("|") and not fenced:
            cells = re.split(r"(?<!\\)\|", bare)[1:-1]
            yield from (Text(number, "page", cell) for cell in cells if len(cell.split()) > 3)
        elif bare and not fenced and not bare.startswith("#"):
            start = start if gathered else number
            gathered.append(re.sub(r"^(?:[-*]|\d+\.) ", "", bare))


def texts_of_module(source: str) -> Iterator[Text]:
    """Docstrings, messages and comments of a Python module."""
    tree = ast.parse(source)
    docstrings = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                docstrings.add(id(first.value))
    yield from _strings(tree, docstrings)
    yield from _comments(source, "#", "  ")


def _strings(tree: ast.AST, docstrings: set[int]) -> Iterator[Text]:
    inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [
                part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else "`x`"
                for part in node.values
            ]
            text = "".join(parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner:
            text = node.value
        else:
            continue
        if id(node) in docstrings:
            yield Text(node.lineno, "docstring", text)
        elif len(re.findall(r"\b[A-Za-z][a-z]*\b", text)) > 3 and not re.search(r"[{}<>;\\]|\w\(|\w=", text):
            yield Text(node.lineno, "message", text)


def texts_of_words(source: str) -> Iterator[Text]:
    """The values of a JSON object: the page's words."""
    for number, line in enumerate(source.splitlines(), 1):
        for value in re.findall(r': ("(?:[^"\\]|\\.)*")', line):
            yield Text(number, "message", json.loads(value))


def _comments(source: str, mark: str, gap: str = "  ?") -> Iterator[Text]:
    """Comments behind `mark`; those on lines that follow one another are one text. gap: between code and
    comment.
    """
    whole = re.compile(rf"^\s*(?:{mark})(?!!) ?(.*)$")
    behind = re.compile(rf"\S{gap}{'#' if mark == '#' else '///?'} (.*)$")
    start, gathered = 0, list[str]()
    for number, line in enumerate([*source.splitlines(), ""], 1):
        if found := whole.match(line):
            start = start if gathered else number
            gathered.append(found[1])
            continue
        if gathered:
            yield Text(start, "comment", "\n".join(gathered))
            gathered = []
        if found := behind.search(line):
            yield Text(number, "comment", found[1])


def texts_of(path: Path) -> Iterator[Text]:
    source = path.read_text("utf-8")
    if path.suffix == ".md":
        yield from texts_of_page(source)
    elif path.suffix == ".py":
        yield from texts_of_module(source)
    elif path.suffix == ".json":
        yield from texts_of_words(source)
    elif path.suffix in C_LIKE:
        yield from _comments(source, r"///?|\*|/\*\*?")
    else:
        yield from _comments(source, "#")


def files(root: Path = ROOT) -> list[Path]:
    """Files that git knows and people read; scripts have an ending, or their program in the first line."""
    asked = [*FOLDERS, *PAGES]
    listed = subprocess.run(["git", "ls-files", "-z", "--", *asked], cwd=root, capture_output=True, text=True)
    listed.check_returncode()
    suffixes = {".py", ".md"} | C_LIKE | SCRIPTS
    paths = [root / name for name in listed.stdout.split("\0") if name]
    return [path for path in paths if path.is_file() and (path.suffix in suffixes or _is_read(path, root))]


def _is_read(path: Path, root: Path) -> bool:
    if path.suffix:
        return path == root / WORDS
    with path.open("rb") as stream:
        return stream.read(2) == b"#!"


def findings_in(path: Path, root: Path = ROOT) -> list[Finding]:
    name = str(path.relative_to(root))
    return [
        Finding(name, one.line, one.kind, tic, sentence)
        for one in texts_of(path)
        for tic, sentence in tics_in(one.text, one.kind)
    ]


def findings(root: Path = ROOT) -> list[Finding]:
    return [one for path in files(root) for one in findings_in(path, root)]


def main() -> None:
    options = argparse.ArgumentParser(prog="python -m tools.english", description=__doc__)
    options.add_argument("paths", nargs="*", help="files or folders, all without any")
    options.add_argument("--by-room", action="store_true", help="counts of each folder in place of the list")
    asked = options.parse_args()
    found = findings()
    if asked.by_room:
        rooms = Counter(
            "/".join(one.path.split("/")[:2][: 2 if one.path.count("/") > 0 else 1]) for one in found
        )
        print("\n".join(f"{count:6} {room}" for room, count in rooms.most_common()))
    else:
        wanted = tuple(asked.paths)
        print("\n".join(str(one) for one in found if one.path.startswith(wanted or "")))


if __name__ == "__main__":
    main()
