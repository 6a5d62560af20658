"""Shipped scenes, studies and descriptions of data sets: where they are, by name, in a checkout and in a wheel.

A checkout has them at its root, in `scenes`, `studies` and `vision`; building a wheel (setup.py) copies these folders
beside this file. A name comes in, `cell_delivery` or `scenes/cell_delivery.usda`, and the path of the file goes out.
"""

from __future__ import annotations

import os
from pathlib import Path

from otwarp.errors import InputError, nearest

ENDINGS = {"scenes": ".usda", "studies": ".toml", "vision": ".toml"}
"""Kinds of shipped files: their folder, and their ending."""

SCENES = {
    "cell_delivery": "Two robots carry a cell past pillars and moving cubes: the paper's task.",
    "force_models": "Four equal beads, each held by a beam under one of the four force models.",
    "hold": "A robot of one sphere held by one trap in a channel's flow: with how little power?",
    "microfluidic_channel": "A robot held in a channel's flow, with 200 cells that drift past pillars.",
    "navigate": "A robot of one sphere and one trap, past pillars and swinging boxes to a goal.",
    "push": "A robot of one sphere and a cell that nothing holds, in a shallow chamber.",
    "robot_hold": "A robot in its three traps, in a stream: which sphere lets go first?",
    "single_bead": "One bead at rest in one harmonic trap.",
    "strategy_a": "Two traps part, and a pair of spheres lies down in the plane.",
    "strategy_b": "Two traps of unequal power tilt a five-element robot.",
    "table_trap": "One bead beside a tabulated trap: what studies of capture and escape start from.",
    "teleop_small": "A robot for each hand, one cell and one pillar, to steer live.",
    "ten_thousand_cells": "Ten thousand cells in a closed chamber.",
    "transport": "One bead in a trap that moves straight on: how fast can it be carried?",
    "two_trap_dimer": "A rigid pair of spheres, each in a trap of its own.",
}
"""What each shipped scene shows."""

TEMPLATES = {"channel": "channel.usda", "robot": "robot.usda", "chamber": "chamber.usda", "study": "study.toml"}
"""Files of `otwarp new`, with comments, in the folder `templates` of the package."""


def folder(kind: str) -> Path:
    """The folder of a kind of shipped files, of the wheel or of the checkout."""
    here = Path(__file__).resolve().parent
    packaged = here / kind
    return packaged if packaged.is_dir() else here.parents[1] / kind


def names(kind: str) -> list[str]:
    """Names of all shipped files of a kind, sorted."""
    return sorted(file.stem for file in folder(kind).glob(f"*{ENDINGS[kind]}"))


def kinds_of() -> dict[str, list[str]]:
    """Every shipped name once, with what is called so: several kinds may have one name."""
    found: dict[str, list[str]] = {}
    for kind, what in (("scenes", "scene"), ("studies", "study"), ("vision", "data set")):
        for name in names(kind):
            found.setdefault(name, []).append(what)
    return found


def named(kind: str, said: str | Path) -> Path | None:
    """The shipped file that is meant by a name.

    Args:
        kind: One of `ENDINGS`.
        said: `NAME`, `NAME.usda` or `scenes/NAME.usda`, and so for other kinds.

    Returns:
        Its path, or None if no shipped file is called that.
    """
    path, ending = Path(said), ENDINGS[kind]
    plain = path.suffix in ("", ending) and path.as_posix() in (path.name, f"{kind}/{path.name}")
    file = folder(kind) / f"{path.stem}{ending}"
    return file if plain and file.is_file() else None


def find(kind: str, said: str | Path, *, beside: Path | None = None) -> Path:
    """A user's file, or else the shipped one of that name.

    Args:
        kind: One of `ENDINGS`.
        said: A path, or the name of a shipped file.
        beside: Folder that a relative path starts from; None for the present one.

    Returns:
        The path where there is a file, else that of the shipped file which is called so, else the path.

    Raises:
        InputError: Neither a text nor a path.
    """
    if not isinstance(said, str | os.PathLike):
        raise InputError(f"file of {kind} is {said!r}; allowed: a path, or the name of a shipped one")
    path = Path(said) if beside is None else beside / said
    return path if path.is_file() else named(kind, said) or path


def shipped(kind: str, name: str) -> Path:
    """The shipped file of a name.

    Raises:
        InputError: There is none.
    """
    file = named(kind, name)
    if file is None:
        raise InputError(f"{name}: is none of the shipped {kind}; allowed: {', '.join(names(kind))}")
    return file


def hint(kind: str, said: str | Path) -> str:
    """What ends the message about a name that is neither a file nor shipped: the nearest name, and how to list all."""
    near = nearest(Path(said).stem, names(kind))
    listed = "`otwarp scenes list` names all of them"
    return f"{near} {listed}" if near.startswith("; did") else f"; {listed}"


def about(kind: str, name: str) -> str:
    """What a shipped file is, in one sentence: a scene's from `SCENES`, others' from their first lines."""
    if kind == "scenes":
        return SCENES[name]
    lines = shipped(kind, name).read_text(encoding="utf-8").splitlines()
    head = [line.lstrip("# ").rstrip() for line in lines[: next(n for n, t in enumerate(lines) if t[:1] != "#")]]
    text = " ".join(head)
    ends = [n for mark in (". ", ", for a network", "; ", ": `") if (n := text.find(mark)) > 0]
    return text[: min(ends, default=len(text))].rstrip(".") + "."


def template(kind: str) -> str:
    """The text of a template, a row of `TEMPLATES`."""
    return (Path(__file__).resolve().parent / "templates" / TEMPLATES[kind]).read_text(encoding="utf-8")
