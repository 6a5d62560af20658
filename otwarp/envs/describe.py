"""Tables of what an environment's numbers mean, for the terminal and for pages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from otwarp.envs.layout import Layout
from otwarp.envs.registration import own_spaces
from otwarp.envs.task import Task


def described(task: Task) -> dict[str, Any]:
    """An environment as plain data: observations, actions, rewards, ends, and what differs between episodes."""
    layout = Layout(task, task.load())
    row = lambda c: {"name": c.name, "unit": c.unit, "scale": c.scale, "meaning": c.meaning}  # noqa: E731
    numbers = {"observations": [row(c) for c in layout.seen], "actions": [row(c) for c in layout.acted]}
    own = own_spaces(task.name, "described")
    return {
        "name": task.name,
        "description": task.description,
        "rate": task.rate,
        "time_limit": task.time_limit,
        "speed_limit": task.speed_limit,
        **(own() if own else numbers),
        "chosen": own is not None,
        "choices": [list(c) for c in task.choices],
        "rewards": [{"name": t.name, "unit": t.unit, "weight": t.weight, "meaning": t.told} for t in task.rewards],
        "ends": [{"name": t.name, "success": t.success, "meaning": t.told} for t in task.ends],
        "shifts": [
            {"prims": [*s.bodies, *s.traps], "half": list(s.half), "middle": list(s.middle)} for s in task.shifts
        ],
        "goal_half": list(task.goal_half),
        "randomised": [name if isinstance(name, str) else ", ".join(name) for name in task.randomise],
        "observation": task.observation,
        "image_size": list(task.image_size),
        "expert": task.expert is not None,
    }


def number_text(value: float) -> str:
    """A number as tables have it."""
    return f"{value:g}"


HEAD = """# What the numbers of the environments mean

Written by `otwarp envs describe -o docs/environments_tables.md`. Observations are divided by what 1 stands for, and cut
off at ±10; actions are within ±1, or the number of a choice. [environments.md](environments.md) says how they are used.

"""
CHOICES = ("choice", "stands for", "meaning")
"""Head of the table of actions where an action is the number of a row."""
TABLES = {
    "observations": ("observation", "1 stands for", "meaning"),
    "actions": ("action", "1 stands for", "meaning"),
    "rewards": ("reward", "weight", "meaning"),
    "ends": ("end", "wanted", "meaning"),
}
"""Tables of most environments, and their heads."""


def table(shown: dict[str, Any], which: str) -> list[tuple[str, str, str]]:
    """Rows of one of `TABLES`."""
    rows = []
    for entry in shown[which]:
        unit = "" if entry.get("unit", "1") == "1" else f" {entry['unit']}"
        if which == "rewards":
            middle = f"{number_text(entry['weight'])}{f' per{unit}' if unit else ''}"
        elif which == "ends":
            middle = "yes" if entry["success"] else "no"
        else:
            middle = f"{number_text(entry['scale'])}{unit}"
        rows.append((entry["name"], middle, entry["meaning"]))
    return rows


def heads(shown: dict[str, Any]) -> dict[str, tuple[str, str, str]]:
    """Tables of an environment, and their heads."""
    return TABLES | ({"actions": CHOICES} if shown["chosen"] else {})


def facts(shown: dict[str, Any]) -> str:
    """What is no table, in a line."""
    parts = [
        f"{number_text(shown['rate'])} Hz",
        f"at most {number_text(shown['time_limit'])} s",
        f"hands up to {number_text(shown['speed_limit'])} µm/s",
    ]
    if shown["choices"]:
        parts.append(f"{len(shown['choices'])} choices of these numbers")
    if shown["observation"] != "state":
        wide, high = shown["image_size"]
        how = "instead of" if shown["observation"] == "image" else "beside"
        parts.append(f"an image of {wide} × {high} pixels is observed {how} these numbers")
    if shown["randomised"]:
        parts.append(f"randomised: {', '.join(shown['randomised'])}")
    return "; ".join(parts) + "."


def page(tasks: Iterable[Task]) -> str:
    """The page of all environments, as `otwarp envs describe -o FILE` writes it."""
    return HEAD + "\n".join(_section(described(task)) for task in tasks)


def _section(shown: dict[str, Any]) -> str:
    """The tables of an environment as Markdown."""
    lines = [f"## {shown['name']}", "", shown["description"], f"Control: {facts(shown)}"]
    for which, head in heads(shown).items():
        lines += ["", f"| {' | '.join(head)} |", "|---|---:|---|"]
        lines += [f"| `{name}` | {middle} | {meaning} |" for name, middle, meaning in table(shown, which)]
    return "\n".join(lines) + "\n"
