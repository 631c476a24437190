"""Pages that hold together: tables, examples, links, commands. What they describe is tested, or says not."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
from PIL import Image, ImageChops, ImageSequence
from pydantic import BaseModel, ValidationError

from appliance.cli.app import PLUG_INS, parser, plug_ins
from appliance.levers.addresses import FORMS
from appliance.show import describe
from appliance.show.box import BoxConfig
from appliance.show.section import Section
from appliance.show.show import ShowConfig
from appliance.show_control.command import command
from appliance.studio.autoencoder.losses import LossWeights
from appliance.studio.data.catalogue import CatalogueFile
from tests.test_readme import PAGES as RUN_BY_TEST_README

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
PARTIAL = ("missing", "refused")  # kinds of errors of a file's part; unknown keys and values are others
OWN_READERS = {"still", "left-wrist"}  # excerpts of an experiment, a key file: no configuration
FOR_ENGINEERS = {
    *("CHANGELOG.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "SECURITY.md"),
    *("experiments.md", "firmware.md", "house.md", "image.md", "notebook.md", "releases.md", "units.md"),
}
REFERENCE = {"configuration.md", "journal.md", "osc.md", "outputs.md", "wire.md"}
FOR_USERS = [page for page in PAGES if page.name not in FOR_ENGINEERS | REFERENCE]
LINES_AT_MOST = 3000  # what a person may be asked to read
OWN_COMMANDS = {"CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "experiments.md", "house.md", "notebook.md"}
WITH_ANCHORS = {".py", ".sh", ".js", ".json", ".h", ".cpp", ".ino", ".yaml", ".toml", ".service", ".md", ""}


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


LINK = re.compile(r"\]\(([^)\s]+)\)")
PAGE_NAMED = re.compile(r"\bdocs/([a-z-]+\.md)(?:#([a-z0-9-]+))?")


def anchors(page: Path) -> set[str]:
    """What a link to a heading of a page may say behind the #, as GitHub writes it."""
    headings = [
        line.lstrip("#").strip() for _, line in prose(page.read_text("utf-8")) if line.startswith("#")
    ]
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in plain}


def leads_nowhere(source: Path, target: str) -> bool:
    path, _, anchor = target.partition("#")
    page = source.parent / path if path else source
    return not page.exists() or bool(anchor and page.suffix == ".md" and anchor not in anchors(page))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_their_anchors_lead_somewhere(page: Path) -> None:
    targets = [target for target in LINK.findall(page.read_text("utf-8")) if "://" not in target]
    assert [target for target in targets if leads_nowhere(page, target)] == []


def test_a_link_to_no_heading_is_found() -> None:
    glossary = ROOT / "docs" / "glossary.md"
    assert leads_nowhere(glossary, "#hands")
    assert leads_nowhere(glossary, "nowhere.md")
    assert not leads_nowhere(glossary, "faq.md")
    assert not leads_nowhere(glossary, "#joints")


def files_that_people_read() -> Iterator[Path]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("this is no git checkout")
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file() and Path(name).suffix in WITH_ANCHORS and name != "tests/test_docs.py":
            yield ROOT / name


def test_pages_that_messages_and_comments_name_exist() -> None:
    """Also those of the scripts and of the firmware: a message that names a page is the only help at 7 pm."""
    nowhere = {}
    for file in files_that_people_read():
        text = file.read_text("utf-8", errors="ignore")
        for name, anchor in PAGE_NAMED.findall(
            text.replace("docs/fixture-format.md", "")
        ):  # another project's
            page = ROOT / "docs" / name
            if not page.is_file() or (anchor and anchor not in anchors(page)):
                nowhere[str(file.relative_to(ROOT))] = f"docs/{name}#{anchor}"
    assert nowhere == {}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_of_source_that_pages_name_exist(page: Path) -> None:
    folders = ("appliance", "deploy", "firmware", "hw_sim", "tests", "tools", "distributions")
    known = [f"/{path.relative_to(ROOT)}" for folder in folders for path in (ROOT / folder).rglob("*.*")]
    named = set(SOURCE.findall(page.read_text("utf-8")))
    assert {one for one in named if not any(path.endswith(f"/{one}") for path in known)} == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_by_osc_are_taken_by_the_box(page: Path) -> None:
    """oscsend hears nothing of a command that is none."""
    families, refused = {address.split("/")[1] for address in FORMS}, {}
    for one, sent, other, said in SENT.findall(page.read_text("utf-8")):
        address, words = one or other, (sent or said).split()
        is_path = not one and address.split("/")[1] not in families
        if is_path or re.search(r"\b[A-Z]{2,}\b|\.\.", " ".join(words)):
            continue  # or words that stand for others
        numbers = [float(word) if re.fullmatch(r"-?[\d.]+", word) else word for word in words]
        try:
            command(address, numbers)
        except ValueError as error:
            refused[f"{address} {words}"] = str(error)
    assert refused == {}


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "notebook.md"], ids=lambda p: p.name)
def test_buttons_and_parts_of_the_page_are_called_as_they_are_there(page: Path) -> None:
    words = json.loads((ROOT / "appliance/console/page/words/en.json").read_text("utf-8")).values()
    known = "|".join(re.sub(r"\\\{name\\\}", r"[\\w-]+", re.escape(one)) for one in words)
    text = "\n".join(line for _, line in prose(page.read_text("utf-8")))
    named = {found.replace("\n", " ") for found in EMPHASISED.findall(re.sub(r"`[^`]*`", "", text))}
    assert {one for one in named if not re.fullmatch(known, one)} - NOT_ON_THE_PAGE == set()


TESTED_BY = re.compile(r"<!-- tested by ([^>]+) -->")
IS_COMMAND = re.compile(
    r"\s*(?:\$ )?(?:sudo )?(bunraku(?:-[a-z-]+)?|make|apt|dd|oscsend|torchrun|arduino-cli|blender|nmcli"
    r"|systemctl|python|ffmpeg|journalctl|cp|mount)(?: +([a-z-]+))?"
)
SENT = re.compile(r"oscsend \S+ \d+ (/\S+)(?: [sifTF]+)?((?: [^\s;&|`]+)*)|`(/[\w/]+)((?: [\w.-]+)+)`")
SOURCE = re.compile(r"`([\w./-]+\.(?:py|js|cpp|h|sh|ino))`")
EMPHASISED = re.compile(r"(?<![*\w])\*([A-Z][^*]+)\*(?!\*)")
# Words of other programs and titles of papers; all others in italics are the page's.
NOT_ON_THE_PAGE = {
    *("Generic OSC", "Network Streamer", "OSC/VMC", "Position + Orientation (Quaternion)", "Quaternion"),
    *("Use custom", "Question about a show", "Security", "Report a vulnerability", "Nulls:"),
    *("Puppeteering an AI", "Beyond Imitation"),
}
UNTRIED = ("(not tried", "not tried:", "tried by hand")


def fences(page: str) -> Iterator[tuple[int, str, list[str], str]]:
    """Line, kind and content of each fence, and the paragraph and the comment before it."""
    lines, begun, kind = page.splitlines(), 0, ""
    for number, line in enumerate(lines):
        if not line.lstrip().startswith("```"):
            continue
        if begun:
            before = "\n".join(lines[: begun - 1]).rstrip()
            yield begun, kind, lines[begun:number], "\n".join(before.splitlines()[-8:])
            begun = 0
        else:
            begun, kind = number + 1, line.strip().removeprefix("```")


def untested(page: str, text: str) -> Iterator[str]:
    """Blocks of commands that no test runs and that do not say so; page: its path in the checkout."""
    for line, kind, body, before in fences(text):
        commands = [found.groups() for row in body if (found := IS_COMMAND.match(row))]
        run = kind == "sh" and page in RUN_BY_TEST_README
        if not commands or run or any(words in before for words in UNTRIED):
            continue
        named = TESTED_BY.search(before.rpartition("\n")[2])
        files = [ROOT / name for name in named[1].split()] if named else []
        if not files:
            yield f"{page}:{line}: neither run, nor tested, nor marked '(not tried)'"
        tests = "".join(file.read_text("utf-8") for file in files if file.is_file())
        for program, word in commands:
            if files and program.startswith("bunraku") and not re.search(rf"\b{word}\b", tests):
                yield f"{page}:{line}: {named[1] if named else ''} does not run '{program} {word}'"


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.name not in OWN_COMMANDS], ids=lambda p: p.name
)
def test_each_path_is_walked_by_a_test_or_marked(page: Path) -> None:
    assert list(untested(str(page.relative_to(ROOT)), page.read_text("utf-8"))) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("```text\nbunraku check\n```\n", 1),
        ("(not tried)\n\n```text\nbunraku check\n```\n", 0),
        ("<!-- tested by tests/test_docs.py -->\n```text\nbunraku check\n```\n", 0),
        ("<!-- tested by tests/test_start.py -->\n```text\nbunraku quadrille\n```\n", 1),
        ("<!-- tested by tests/nowhere.py -->\n```text\nbunraku check\n```\n", 1),
        ("```text\nWhat it prints.\n```\n", 0),
    ],
)
def test_an_unmarked_block_is_found(text: str, found: int) -> None:
    assert len(list(untested("page.md", text))) == found


def test_each_step_from_the_shop_to_the_wall_says_what_one_sees_and_whether_it_was_tried() -> None:
    page = (ROOT / "docs" / "raspberry-pi.md").read_text("utf-8")
    steps = re.findall(r"(?ms)^\d+\. (.+?)(?=^\d+\. |^[A-Z#])", page)
    assert len(steps) == 12
    for step in steps:
        assert "You see: " in step, step
        tested = TESTED_BY.search(step)
        assert "(not tried" in step or (tested and (ROOT / tested[1]).is_file()), step


def test_the_map_of_the_house_has_every_room() -> None:
    """`house.md` says what each folder of the product is for."""
    rows = re.findall(r"^\| (.+?) \|", (ROOT / "docs" / "house.md").read_text(), re.MULTILINE)
    named = set(re.findall(r"`(?:appliance/)?(\w+)`", " ".join(row for row in rows if "`appliance/" in row)))
    assert {one.parent.name for one in (ROOT / "appliance").glob("*/__init__.py")} <= named


def test_pages_for_users_are_short_enough_to_be_read() -> None:
    lines = {page.name: len(page.read_text("utf-8").splitlines()) for page in FOR_USERS}
    assert sum(lines.values()) < LINES_AT_MOST, lines


def test_the_readme_leads_to_every_page() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    named = {Path(target.partition("#")[0]).name for target in LINK.findall(readme)}
    assert {page.name for page in PAGES} - named == {"README.md", "CHANGELOG.md", "CODE_OF_CONDUCT.md"}


def test_the_table_of_commands_is_that_of_the_help() -> None:
    page = (ROOT / "docs" / "commands.md").read_text("utf-8")
    asked = [Path(sys.executable).parent / "bunraku", "--help"]
    printed = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    shown = printed.partition("Commands:")[2]
    assert re.findall(r"(?m)^\| `bunraku ([a-z]+)` \|", page) == re.findall(r"(?m)^  ([a-z]+)  ", shown)


def test_the_first_thing_to_see_is_six_seconds_of_a_hand_and_its_answer() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    picture = re.search(r"!\[.+\]\((.+?)\)", readme)
    assert picture
    assert readme.index(picture[0]) < 200
    loop = ROOT / picture[1]
    assert loop.stat().st_size < 2_000_000
    with Image.open(loop) as opened:
        frames = [(frame.convert("L"), frame.info["duration"]) for frame in ImageSequence.Iterator(opened)]
    seconds = sum(duration for _, duration in frames) / 1000
    pictures = [picture for picture, _ in frames]
    moved = [0, 0]
    for before, now in pairwise(pictures):
        changed = ImageChops.difference(before, now).point(lambda value: 255 * (value > 60))
        for half in (0, 1):
            box = (half * now.width // 2, 0, (half + 1) * now.width // 2, now.height)
            moved[half] += changed.crop(box).histogram()[255]
    assert seconds == pytest.approx(6.0, abs=0.1)
    assert 0 < moved[0] < moved[1]  # one arm on the left, a whole body on the right


def test_every_picture_is_shown() -> None:
    shown = {Path(target).name for page in PAGES for target in LINK.findall(page.read_text("utf-8"))}
    assert {path.name for path in (ROOT / "docs" / "pictures").iterdir()} - shown == set()
