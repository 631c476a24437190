"""Pages that hold together: whole tables, and examples and defaults that the box reads."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import BaseModel, ValidationError

from appliance.cli.app import PLUG_INS, parser, plug_ins
from appliance.show import describe
from appliance.show.box import BoxConfig
from appliance.show.section import Section
from appliance.show.show import ShowConfig
from appliance.studio.autoencoder.losses import LossWeights
from appliance.studio.data.catalogue import CatalogueFile

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
PARTIAL = ("missing", "refused")  # kinds of errors of a file's part; unknown keys and values are others
OWN_READERS = {"still", "left-wrist"}  # excerpts of an experiment, a key file: no configuration


def prose(page: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, without what is in fences."""
    fenced = False
    for number, line in enumerate(page.splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        yield number, "" if fenced else line


def cells(row: str) -> int:
    return len(re.findall(r"(?<!\\)\|", row.strip())) - 1


def broken_tables(page: str) -> list[str]:
    """Rows that a reader of Markdown shows otherwise than they are meant."""
    found, columns = [], 0
    for number, line in prose(page):
        row = line.strip()
        if row.startswith("|"):
            columns = columns or cells(row)
            if not columns or cells(row) != columns or not row.endswith("|"):
                found.append(f"{number}: {cells(row)} of {columns} columns")
            continue
        if columns and row:
            found.append(f"{number}: a table goes over into '{row[:40]}'")
        if re.search(r"(?<!\\)\|$", row):
            found.append(f"{number}: a row in pieces")
        columns = 0
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_are_whole(page: Path) -> None:
    assert broken_tables(page.read_text("utf-8")) == []


@pytest.mark.parametrize(
    "table",
    [
        "| a | b |\n|---|---|\n| `x` | one |\n|y|\n",
        "| a | b |\n|---|---|\n| `x` | one\n\n    two\n |\n",
        "| a | b |\n|---|---|\n| `x` | one | two |\n",
        "| a | b |\n|---|---|\n| `x` | one |\nThis page.\n",
    ],
)
def test_a_broken_table_is_found(table: str) -> None:
    assert broken_tables(table)
    assert not broken_tables("| a | b |\n|---|---|\n| `x \\| y` | one |\n\n```\n| a\n```\n")


def sections(model: type[Section]) -> Iterator[type[Section]]:
    """A section and all that are in it."""
    yield model
    for field in model.model_fields.values():
        below = describe.section(field.annotation)
        if below is not None:
            yield from sections(below)


ALL_SECTIONS = list(dict.fromkeys([*sections(ShowConfig), *sections(BoxConfig), CatalogueFile]))


def troubles(model: type[BaseModel], values: Any) -> list[str]:
    """Why a section refuses values, but for what the rest of the file would have: 'missing', 'refused'."""
    try:
        model.model_validate(values)
    except ValidationError as error:
        return [f"{one['loc']}: {one['msg']}" for one in error.errors() if one["type"] not in PARTIAL]
    return []


def examples() -> Iterator[Any]:
    for page in PAGES:
        text = page.read_text("utf-8")
        for block in re.finditer(r"```yaml\n(.*?)```", text, re.DOTALL):
            line = text[: block.start()].count("\n") + 2
            for part in re.split(r"(?m)^# (?:show|box)\.yaml\n", block[1]):
                if part.strip():
                    yield pytest.param(part, id=f"{page.name}:{line}")


@pytest.mark.parametrize("example", list(examples()))
def test_examples_are_keys_that_the_box_reads(example: str) -> None:
    values = yaml.safe_load(example)
    if isinstance(values, dict) and values.keys() & OWN_READERS:
        return
    for one in values if isinstance(values, list) else [values]:
        refused = {model.__name__: troubles(model, one) for model in ALL_SECTIONS}
        assert [] in refused.values(), {name: why for name, why in refused.items() if len(why) < 3}


def rows_of_the_reference() -> Iterator[Any]:
    """Section and its path, key, and default of every row of docs/configuration.md."""
    model: type[Section] | None = None
    tops = {"show.yaml": ShowConfig, "box.yaml": BoxConfig}
    top: type[Section] = ShowConfig
    path = ""
    for _, line in prose((ROOT / "docs" / "configuration.md").read_text("utf-8")):
        if line.startswith("## "):
            path = line[3:]
            model = top = tops[path]
        elif line.startswith("### "):
            path, model = line[4:], top
            for name in path.replace("[ ]", "").split("."):
                assert model is not None
                model = describe.section(keys_of(model)[name].annotation)
        elif line.startswith("| `"):
            key, _, default, _ = (cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
            yield pytest.param(model, key.strip("`"), default, id=f"{path}.{key}")


def keys_of(model: type[Section]) -> dict[str, Any]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


@pytest.mark.parametrize(("model", "key", "default"), list(rows_of_the_reference()))
def test_a_key_of_the_reference_loads_with_the_default_that_it_names(
    model: type[Section], key: str, default: str
) -> None:
    if default == "**needed**":
        assert keys_of(model)[key].is_required()
        return
    if not default.startswith("`"):  # in words: a section's own defaults
        default = "`{}`" if default == "its own defaults" else "`[{}]`"
    written = yaml.safe_load(default.strip("`"))
    assert [one for one in troubles(model, {key: written}) if one.startswith(f"('{key}',")] == []
    own = keys_of(model)[key].get_default(call_default_factory=True, validated_data={})
    if "`" in default and default not in ("`{}`", "`[{}]`"):
        assert written == json.loads(json.dumps(own, default=str))


def test_the_page_on_training_has_each_loss_of_the_default_network() -> None:
    page = (ROOT / "docs" / "training.md").read_text("utf-8")
    table = page.partition("| loss | what it compares |")[2].partition("\n\n")[0]
    named = set(re.findall(r"(?m)^\| ([a-z ]+) \|", table))
    weights = LossWeights(speed=0.0, squared=0.0, divergence=0.0)  # those of other models
    assert named == {name.replace("_", " ") for name, weight in vars(weights).items() if weight}


COMMAND = re.compile(r"(?:^|\$|sudo|&&|;|\||\() *bunraku((?: +[^\s`|&;>()]+)+)")


def commands_in(page: str) -> Iterator[tuple[int, list[str]]]:
    """Words behind `bunraku` in code spans and fences, with their line."""
    fenced = False
    for number, line in enumerate(page.splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
            continue
        for code in [line] if fenced else re.findall(r"`([^`]+)`", line):
            for found in COMMAND.finditer(code.partition(" # ")[0]):
                yield number, found[1].split()


def strange_words(words: list[str], command: Any) -> list[str]:
    """Commands and options that bunraku does not have."""
    while getattr(command, "commands", None) and words and re.fullmatch(r"[a-z][a-z-]*", words[0]):
        if words[0] not in command.commands:
            return [words[0]]
        command, words = command.commands[words[0]], words[1:]
    options = {name for one in command.params for name in (*one.opts, *one.secondary_opts)}
    asked = [word.partition("=")[0].rstrip(",.:") for word in words if word.startswith("--")]
    return [word for word in asked if word not in options | {"--help"}]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_of_the_pages_exist(page: Path) -> None:
    bunraku = parser(None, plug_ins(entry_points(group=PLUG_INS)))
    strange = {
        f"{page.name}:{number}": found
        for number, words in commands_in(page.read_text("utf-8"))
        if (found := strange_words(words, bunraku))
    }
    assert strange == {}


def test_an_option_that_is_none_is_found() -> None:
    bunraku = parser(None, plug_ins(entry_points(group=PLUG_INS)))
    (found,) = commands_in("Type `sudo bunraku journal export --to-stick --bvh FILE`, or bunraku dance.")
    assert strange_words(found[1], bunraku) == ["--to-stick"]
    assert strange_words(["dance"], bunraku) == ["dance"]
