"""The documents: what they link to exists, what they tell to type can be typed, what they name is there."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
from pathlib import Path

import click
import pytest

from otwarp.cli.main import cli
from tests.documents import DOCUMENTS, ROOT, Document

FACADES = {"otwarp", "otwarp.scene", "otwarp.optics", "otwarp.hydrodynamics"}
"""Where README's imports of the package end."""

WRITTEN = ("scene.md", "paper.md", "environments_tables.md")
"""Pages that commands write, beside those of benchmarks and validation."""

every_document = pytest.mark.parametrize("document", DOCUMENTS, ids=str)
every_page = pytest.mark.parametrize("document", [d for d in DOCUMENTS if d.path.name != "CHANGELOG.md"], ids=str)
"""The changelog names what is gone."""


@every_document
def test_links_and_images_resolve(document: Document):
    for target in document.links():
        name, _, anchor = target.partition("#")
        path = (document.path.parent / name).resolve() if name else document.path
        assert path.exists(), f"{document}: {target}"
        if anchor and path.suffix == ".md":
            assert anchor in Document(path).anchors(), f"{document}: {target}"


def test_every_page_is_reached_from_the_index():
    index = ROOT / "docs" / "index.md"
    direct = {(index.parent / target.partition("#")[0]).resolve() for target in Document(index).links()}
    pages = set((ROOT / "docs").glob("*.md")) - {index}
    assert pages <= direct, f"not in docs/index.md: {sorted(p.name for p in pages - direct)}"
    # generated pages are listed by the page that is made of them
    for folder in ("benchmarks", "validation"):
        page = ROOT / "docs" / f"{folder}.md"
        listed = {(page.parent / target.partition("#")[0]).resolve() for target in Document(page).links()}
        assert set((ROOT / "docs" / folder).glob("*.md")) <= listed, folder


def test_every_picture_is_shown():
    shown = {(d.path.parent / target).resolve() for d in DOCUMENTS for target in d.links() if "images/" in target}
    there = {path for path in (ROOT / "docs" / "images").rglob("*") if path.is_file()}
    assert there == {path for path in shown if path.is_file()}


def find_command(words: list[str]) -> tuple[click.Command, list[str]]:
    """The command that `otwarp words…` calls, and the words that are left."""
    command: click.Command = cli
    while isinstance(command, click.Group) and words and not words[0].startswith("-"):
        name, *words = words
        found = command.get_command(click.Context(command), name)
        assert found is not None, f"no command {name!r}"
        command = found
    return command, words


def parse(line: str) -> None:
    """Parse a command line without running it: names, flags, number of arguments, and words to choose from."""
    command, words = find_command(shlex.split(line)[1:])
    context = click.Context(command, info_name=command.name, resilient_parsing=True)
    values, left, _ = command.make_parser(context).parse_args(words)
    assert not left, f"{line}: {left}"
    for parameter in command.params:
        value = values.get(parameter.name)
        if isinstance(parameter.type, click.Choice) and isinstance(value, str):
            parameter.type.convert(value, parameter, context)


@every_document
def test_command_lines_parse(document: Document):
    for line in document.commands("otwarp"):
        try:
            parse(line)
        except (click.ClickException, AssertionError) as error:
            pytest.fail(f"{document}: {line}: {error}")


@every_page
def test_commands_in_prose_exist(document: Document):
    for code in document.inline():
        words = code.split()
        # `otwarp validate` is a command, `otwarp/cache.py` and `otwarp.optics` are not
        if words[0] != "otwarp" or len(words) == 1:
            continue
        command, rest = find_command([word for word in words[1:] if word not in ("…", "...")])
        known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
        for word in rest:
            if word.startswith("--"):
                assert word.partition("=")[0] in known | {"--help"}, f"{document}: {code}"


@every_page
def test_modules_and_targets_of_commands_exist(document: Document):
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    lines = document.commands("python") + document.commands("make") + document.commands(".venv/bin/python")
    for line in [*lines, *document.inline()]:
        match line.split():
            case [("python" | ".venv/bin/python"), "-m", module, *_] if "NAME" not in module:
                assert importlib.util.find_spec(module) is not None, f"{document}: {line}"
            case ["make", target, *_]:
                assert target in targets, f"{document}: {line}"


@every_page
def test_files_that_are_named_exist(document: Document):
    for code in document.inline():
        if re.fullmatch(r"(otwarp|tests|benchmarks|scenes|examples|docs)(/[\w.]+)+/?", code):
            assert (ROOT / code).exists(), f"{document}: {code}"


def imported(block: str) -> list[tuple[str, str]]:
    """(module, name) of what a block of Python imports from the package."""
    found = []
    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [(node.module or "", alias.name) for alias in node.names]
    return [(module, name) for module, name in found if module.partition(".")[0] == "otwarp"]


@every_document
def test_python_imports_what_there_is(document: Document):
    for block in document.blocks("python"):
        for module, name in imported(block):
            if document.path == ROOT / "README.md":
                assert module in FACADES, f"README imports {module}"
            found = importlib.import_module(module)
            if name and not hasattr(found, name):
                assert importlib.util.find_spec(f"{module}.{name}") is not None, f"{document}: {module}.{name}"


def test_the_changelog_leads_to_names_that_exist():
    """Second column of `before | now`: modules, names of modules, and submodules of the module named first."""
    rows = re.findall(r"^\| .*`.* \| (.*`.*) \|$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([a-z_.]+(?:\.[A-Z]\w+)?)(?:\(…\))?`", row)]
    assert len(names) > 20
    base = ""
    for name in names:
        path = name if name.startswith("otwarp") else base.rpartition(".")[0] + name
        base = path if name.startswith("otwarp") else base
        if name.startswith(("otwarp", ".")):
            module, _, attribute = path.rpartition(".")
            assert importlib.util.find_spec(module) is not None, path
            known = hasattr(importlib.import_module(module), attribute)
            assert known or importlib.util.find_spec(path) is not None, path


def test_every_decision_is_in_the_contents_and_leads_to_the_code():
    text = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    head, *decisions = re.split(r"^### ", text, flags=re.MULTILINE)
    titles = [body.splitlines()[0] for body in decisions]
    assert re.findall(r"^- \[(.*)\]\(#.*\)$", head, re.MULTILINE) == titles
    for title, body in zip(titles, decisions, strict=True):
        assert "](" in body or "`python -m" in body, title


def test_no_document_drowns_its_reader():
    """Pages that people write are short; tables are on pages that scripts write."""
    for document in DOCUMENTS:
        path = Path(str(document))
        if path.parts[:2] not in (("docs", "benchmarks"), ("docs", "validation")) and path.name not in WRITTEN:
            limit = {"decisions.md": 620, "README.md": 213, "CHANGELOG.md": 400}.get(path.name, 255)
            assert len(document.text.splitlines()) <= limit, document
