"""Pages of the reference: a page for each command, from click; a page for each room of the package, from docstrings."""

from __future__ import annotations

import ast
from importlib import import_module

import click

from docs.building.links import ROOT

COMMANDS, PYTHON = "reference/commands", "reference/python"

FACADES = {
    "otwarp": "",
    "otwarp.scene": "scene",
    "otwarp.optics": "optics",
    "otwarp.hydrodynamics": "hydrodynamics",
    "otwarp.studies": "studies",
    "otwarp.analysis": "analysis",
}
"""Packages that offer names, which their pages list: package → folder below otwarp/."""

ROOMS = ("record", "preview", "vision", "haptics", "teleop", "perception", "operators", "ros", "simulation")
"""Rooms whose pages, one for each inner room, list their files: a name is imported from the file that holds it."""

FILES = ("errors", "units", "files")
"""Files at the root of the package."""

OUT_OF_SIGHT = {"kernels", "modules"}
"""Inner rooms of code for devices, and of layers of networks."""


def commands() -> dict[str, str]:
    """URI → Markdown, a page for each command of `otwarp`."""
    from otwarp.cli.main import cli

    pages = {}
    for name in cli.list_commands(click.Context(cli)):
        command = cli.get_command(click.Context(cli), name)
        assert command is not None, name
        assert command.callback is not None, name
        home = command.callback.__module__
        attribute = next(key for key, value in vars(import_module(home)).items() if value is command)
        pages[f"{COMMANDS}/{name}.md"] = (
            f"---\ntitle: otwarp {name}\n---\n\n::: mkdocs-click\n    :module: {home}\n    :command: {attribute}\n"
            f"    :prog_name: otwarp {name}\n    :depth: 0\n    :style: table\n"
        )
    return pages


def offered(package: str) -> list[str]:
    """Names that a package offers, as its `__dir__` says, without packages in it."""
    module = import_module(package)
    return [name for name in dir(module) if not name.startswith("_") and name != "analysis"]


def summary(package: str) -> str:
    """First line of a module's docstring."""
    path = ROOT.joinpath(*package.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]


def packages(room: str) -> dict[str, list[str]]:
    """A room and its inner rooms, dotted → the modules in each."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "otwarp" / room).rglob("*.py")):
        package, module = ".".join(path.parent.relative_to(ROOT).parts), path.stem
        if module != "__init__" and not OUT_OF_SIGHT & set(path.parent.parts):
            found.setdefault(package, []).append(f"{package}.{module}")
    return found


def python() -> dict[str, str]:
    """URI → Markdown, a page for each part of the package."""
    pages = {}
    for package in FACADES:
        names = "\n".join(f"::: {package}.{name}\n" for name in offered(package))
        pages[f"{PYTHON}/{package}.md"] = f"# {package}\n\n{summary(package)}\n\n{names}"
    for room in ROOMS:
        for package, modules in packages(room).items():
            names = "\n".join(f"::: {module}\n" for module in modules)
            pages[f"{PYTHON}/{package}.md"] = f"# {package}\n\n{summary(package)}\n\n{names}"
    for file in FILES:
        head = f"# otwarp.{file}\n\n::: otwarp.{file}\n"
        pages[f"{PYTHON}/otwarp.{file}.md"] = f"{head}    options:\n      show_root_heading: false\n"
    return pages
