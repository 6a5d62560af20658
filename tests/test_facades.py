"""What the packages offer to users by name is there, typed, loaded when used, and says what it takes and refuses."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

LAZY = (
    "otwarp",
    "otwarp.hydrodynamics",
    "otwarp.optics",
    "otwarp.analysis",
    "otwarp.operators",
    "otwarp.studies",
    "otwarp.vision",
)
"""Those whose names are all loaded when first used."""

PACKAGES = (*LAZY, "otwarp.scene")

ROOMS = ("analysis",)
"""Names that are those of packages."""


@pytest.mark.parametrize("package", PACKAGES)
def test_names_are_what_type_checkers_see(package):
    module = importlib.import_module(package)
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {a.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for a in node.names}
    if package in LAZY:
        assert sorted(seen) == dir(module)
    else:
        assert set(seen) < set(dir(module)) and dir(module) == sorted(module.__all__)
    for name, home in seen.items():
        # a file of the same name would take the name's place once it is imported
        assert getattr(module, name) is getattr(importlib.import_module(home), name, None) or name in ROOMS, name
    assert set(getattr(module, "__all__", ())) <= {*dir(module), "__version__"}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_name_that_is_not_there_is_an_attribute_error(package):
    with pytest.raises(AttributeError, match=rf"'{package}' has no attribute 'nothing'"):
        _ = importlib.import_module(package).nothing


def offered() -> Iterator[tuple[str, Any]]:
    """Functions and classes that the packages offer, and public methods of the classes, each once."""
    seen: set[int] = set()
    for package in PACKAGES:
        for name in dir(importlib.import_module(package)):
            thing = getattr(importlib.import_module(package), name)
            if id(thing) in seen or not (inspect.isclass(thing) or inspect.isfunction(thing)):
                continue
            seen.add(id(thing))
            yield f"{package}.{name}", thing
            for member, value in vars(thing).items() if inspect.isclass(thing) else ():
                value = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
                if inspect.isfunction(value) and not member.startswith("_"):
                    yield f"{package}.{name}.{member}", value


OFFERED = dict(offered())

PLAIN = (
    "level|accuracy|tolerance|ratio|factor|index|aperture|gamma|share|relative|opacity|filling|brightness|probabilit"
)
PLAIN += "|deviation|magnification|count|coefficient|electrons|interval"
PLAIN += "|micrometres per| over |how much of|in units of|multiples of|pure number"
"""Numbers without a unit, by their names or by what is said of them."""

UNIT = re.compile(rf"\[|µm|mW|pN|\bQ\b|`unit`| s\b|seconds|{PLAIN}", re.IGNORECASE)
"""What says in which unit a number is, or that it has none."""

REFERS = re.compile(r"\b([Aa]s|[Ss]ee|those of|as for|as of)\b[^.]{0,30}`[\w.]+`")
"""Words that leave what is meant to another docstring."""


def entry(doc: str, name: str) -> str:
    """What a docstring says of a parameter: its entry among arguments or attributes, else the whole."""
    found = re.search(rf"^( *)(?:\w+, )*{name}\b(?:, \w+)*: .*(?:\n\1  .*)*", doc, re.MULTILINE)
    return found[0] if found else doc


def parameters(thing: Any) -> list[inspect.Parameter]:
    """Of a function, or of the making of an object; those that stand for any others left out."""
    try:
        found = inspect.signature(thing).parameters.values()
    except ValueError:  # of an exception
        return []
    named = [p for p in found if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    return [p for p in named if p.name not in ("self", "cls")]


@pytest.mark.parametrize("name", OFFERED)
def test_what_is_offered_says_what_it_takes_and_in_which_units(name):
    thing = OFFERED[name]
    doc = inspect.getdoc(thing) or ""
    assert len(doc.split()) > 2 or "[" in doc, doc
    taken = parameters(thing)
    if REFERS.search(doc):
        return
    assert not [p.name for p in taken if not re.search(rf"\b{p.name}\b", doc)]
    numbers = [p for p in taken if re.fullmatch(r"float( \| None)?", str(p.annotation))]
    begin = re.split(r"^(?:Args|Attributes):", doc, flags=re.MULTILINE)[0]
    said = {p.name: entry(doc, p.name) + p.name + (begin if "units of" in begin else "") for p in numbers}
    assert not [name for name, text in said.items() if not UNIT.search(text)]


def raises(thing: Any) -> bool:
    """Whether a function, or the making of an object, raises an `InputError` itself."""
    makers = [vars(thing).get(n) for n in ("__init__", "__post_init__")] if inspect.isclass(thing) else [thing]
    for maker in filter(inspect.isfunction, makers):
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(maker)))
        except OSError:  # made by a dataclass
            continue
        thrown = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc is not None]
        if any("InputError" in ast.unparse(error) for error in thrown):
            return True
    return False


REFUSING = [name for name, thing in OFFERED.items() if raises(thing)]


@pytest.mark.parametrize("name", REFUSING)
def test_what_refuses_says_so(name):
    doc = inspect.getdoc(OFFERED[name]) or ""
    assert re.search(r"^Raises:\n +InputError: \S", doc, re.MULTILINE) or REFERS.search(doc)


def test_there_is_something_to_look_at():
    assert len(OFFERED) > 200 and len(REFUSING) > 40
