"""Docstrings of the package: the modules, classes and functions that they name in backticks are there."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.documents import ROOT

FOREIGN = re.compile(
    r"rmw_\w+|RMW_\w+|RAY_\w+|ros_discovery_info"  # ROS 2, Ray
    r"|dualsense_input_report|data_|_ptr"  # Linux, Cyclone DDS, Warp
    r"|(numpy|hid|wp|Gf|rosbags|law)\..*|\w+\.(nc|usda|usdc|png|toml|pt|html|csv)"
)
"""Names of others, of files, and of variables that are called like a module."""


def stem(path: Path) -> str:
    """Name of a module, or of the room whose docstring it holds."""
    return path.parent.name if path.stem == "__init__" else path.stem


Nodes = list[ast.AST]
"""All of a module, itself first: a tree is walked once, as a thousand files take long."""


def texts(nodes: Nodes) -> Iterator[ast.Constant]:
    """Docstrings, and what stands below constants in their place."""
    for node in nodes:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            for line in node.body:
                if isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant):
                    yield line.value


def defined(nodes: Nodes) -> set[str]:
    """Names that a module imports or defines, functions within functions as well."""
    (tree, *_) = nodes
    assert isinstance(tree, ast.Module)
    outer = [n for s in tree.body for n in (ast.walk(s) if isinstance(s, ast.If | ast.Assign) else [s])]
    named = {n.name for n in nodes if isinstance(n, ast.ClassDef | ast.FunctionDef)}
    named |= {n.target.id for n in outer if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
    named |= {a.asname or a.name for n in outer if isinstance(n, ast.ImportFrom) for a in n.names}
    return named | {n.id for n in outer if isinstance(n, ast.Name)}


def members(nodes: Nodes) -> set[str]:
    """Names of methods, fields and attributes of the classes of a module."""
    classes = [n for n in nodes if isinstance(n, ast.ClassDef)]
    lines = [line for c in classes for line in c.body]
    named = {n.attr for n in nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    named |= {line.name for line in lines if isinstance(line, ast.FunctionDef)}
    return named | {n.target.id for n in lines if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}


def words(nodes: Nodes) -> set[str]:
    """All names that the code of a module has, those in its strings as well."""
    prose = {id(text) for text in texts(nodes)}
    found: set[str] = set()
    for node in nodes:
        names = (getattr(node, field, None) for field in ("id", "arg", "attr", "name", "asname"))
        found.update(name for name in names if isinstance(name, str))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            found.update(re.findall(r"\w+", node.value))
    return found


class Names:
    """What the package defines: by module, as members of classes, and anywhere in its code."""

    def __init__(self, modules: dict[Path, Nodes]):
        self.top: defaultdict[str, set[str]] = defaultdict(set)
        for path, nodes in modules.items():
            self.top[stem(path)] |= defined(nodes)
        self.members = set().union(*map(members, modules.values()), self.top)
        self.words = set(self.top).union(*map(words, modules.values()))

    def has(self, name: str, path: Path) -> bool:
        """Whether the package has what a docstring of `path` calls so."""
        *_, room, last = ("", *name.split("."))
        if room in self.top and (room != stem(path) or name.startswith("otwarp.")):
            return last in self.top[room] or last in self.members
        return last in self.words or not (room or "_" in last)


def test_names_in_docstrings_are_there():
    paths = sorted((ROOT / "otwarp").rglob("*.py"))
    modules = {path: list(ast.walk(ast.parse(path.read_text(encoding="utf-8")))) for path in paths}
    names = Names(modules)
    stale = [
        f"{path.relative_to(ROOT)}:{text.lineno}: {name}"
        for path, nodes in modules.items()
        for text in texts(nodes)
        for name in re.findall(r"`(\w+(?:\.\w+)*)(?:\([^`\n]*\))?`", str(text.value))
        if not names.has(name, path) and not FOREIGN.fullmatch(name)
    ]
    assert not stale, "\n".join(stale)
