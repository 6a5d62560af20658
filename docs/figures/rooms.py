"""The rooms: who may import whom, as the import tests have it, and what the rooms say of themselves."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from docs.figures.style import QUIET, TINTS, arrow, box, canvas, chips, save, text
from tests.test_import_rules import ALLOWED, INNER, PACKAGE, ROOT

NAME = "architecture_rooms"
PAGE = Path(__file__).resolve().parents[1] / "architecture.md"
BEGIN, END = "<!-- begin rooms -->", "<!-- end rooms -->"

SIZE = (11.0, 11.92)
PLACES: dict[str, tuple[float, float, float, float, str, str]] = {
    "cli": (0.25, 11.22, 10.5, 0.42, "grey", "imports every room, inside functions"),
    "reproduce": (0.25, 10.0, 10.5, 0.98, "violet", "the paper's tables and figures, computed anew"),
    "perception": (0.25, 8.82, 3.3, 0.98, "violet", "images that tell a session where its bodies are"),
    "view": (3.7, 8.82, 2.6, 0.98, "violet", "recordings, in the browser"),
    "envs": (6.45, 8.82, 4.3, 0.98, "violet", "environments of Gymnasium"),
    "ros": (0.25, 7.64, 2.6, 0.98, "amber", "bridges to ROS 1 and ROS 2"),
    "operators": (3.05, 7.64, 3.2, 0.98, "amber", "simulated people at the device"),
    "analysis": (6.33, 6.58, 2.25, 0.62, "violet", "what a run or study tells"),
    "studies": (6.33, 5.17, 2.25, 1.32, "violet", "trials at many points"),
    "vision": (8.7, 5.24, 2.05, 1.6, "violet", "what a microscope sees"),
    "teleop": (0.25, 6.32, 6, 0.98, "amber", "a scene, live"),
    "bench": (6.5, 7.3, 4.25, 1.32, "violet", "what accuracy costs on this machine"),
    "record": (3.35, 5.31, 2.65, 0.66, "violet", "a run on disk"),
    "preview": (3.35, 3.97, 1.1, 0.98, "violet", "pictures"),
    "simulation": (4.75, 4.13, 6, 0.98, "red", "Model, State, Control, Readout: the object that steps"),
    "optics": (7.8, 3.26, 2.95, 0.66, "blue", "exact forces, tables, fits"),
    "haptics": (0.25, 0.92, 2.75, 2, "green", "devices, signal chain, servo"),
    "scene": (3.35, 0.92, 2.25, 2.45, "blue", "what a USD stage says"),
    "hydrodynamics": (5.8, 0.92, 1.8, 2, "blue", "mobilities of bodies,\nblobs, walls"),
    "kernels": (7.8, 0.92, 2.95, 2, "blue", "the step, in Warp"),
}
"""Room → x, y, width, height [in], colour, what it is. A new room must be placed."""


def inner_rooms(room: str) -> list[str]:
    """Folders of a room that hold code."""
    folder = PACKAGE / room
    return sorted(p.name for p in folder.iterdir() if (p / "__init__.py").exists()) if folder.is_dir() else []


def inner_files(room: str) -> list[str]:
    """Files of a room that the import tests take for an inner room."""
    names = (key.removeprefix(f"{room}.") for key in INNER if key.startswith(f"{room}."))
    return sorted(name for name in names if (PACKAGE / room / f"{name}.py").is_file())


def data() -> dict[str, Any]:
    """What the picture shows: rooms, whom each may import, their inner rooms; and what stands under them all."""
    rooms = [room for room in ALLOWED if (PACKAGE / room).is_dir() and room not in ROOT]
    imports = {room: sorted(ALLOWED[room] & set(rooms)) for room in rooms}
    return {
        "imports": imports | {"cli": sorted(rooms)},
        "inner": {room: inner_rooms(room) for room in (*rooms, "cli")},
        "common": sorted(ROOT),
        "device": sorted(room for room in rooms if "device" in ALLOWED[room]),
    }


def strong(imports: dict[str, list[str]]) -> set[tuple[str, str]]:
    """Imports that no chain of others implies."""

    def reach(room: str) -> set[str]:
        return set(imports[room]).union(*(reach(other) for other in imports[room]))

    return {
        (room, other)
        for room, others in imports.items()
        for other in others
        if not any(other in reach(between) for between in others)
    }


def draw() -> Any:
    """The figure."""
    shown = data()
    imports, direct = shown["imports"], strong(shown["imports"])
    missing = set(imports) ^ set(PLACES)
    assert not missing, f"place these rooms in docs/figures/rooms.py: {missing}"
    figure, axes = canvas(*SIZE)
    for room, (x, y, width, height, tint, about) in PLACES.items():
        box(axes, x, y, width, height, tint)
        text(axes, x + 0.14, y + height - 0.21, room, size=12, weight="bold", color=TINTS[tint][1])
        if room == "cli":
            text(axes, x + 0.6, y + height - 0.22, about, size=8.8, color=QUIET)
            continue
        text(axes, x + 0.14, y + height - 0.36, about, size=8.8, color=QUIET, va="top", linespacing=1.4)
        end = chips(axes, x + 0.14, y + height - 0.77, width - 0.2, shown["inner"][room], tint)
        assert end > y or not shown["inner"][room], f"make {room} higher in docs/figures/rooms.py"
        also = [other for other in imports[room] if (room, other) not in direct]
        if also:
            words = "also: " + ", ".join(also)
            # smaller where it would run into the name
            size = 6.6 if 0.056 * len(words) + 0.105 * len(room) + 0.28 > width else 8.2
            text(axes, x + width - 0.14, y + height - 0.21, words, size=size, ha="right", color=QUIET, style="italic")
    for room, other in sorted(direct):
        if room != "cli":
            connect(axes, room, other)
    box(axes, 0.25, 0.16, 10.5, 0.58, "grey")
    text(axes, 0.39, 0.57, "below all:  " + "   ".join(shown["common"]), size=9.5)
    words = "device: " + ", ".join(shown["device"])
    text(axes, 10.61, 0.31, words, size=8.2, ha="right", color=QUIET, style="italic")
    return figure


def connect(axes: Any, room: str, other: str) -> None:
    """An arrow from the foot of a room to the head of one that it may import, straight down where they overlap."""
    x, y, width, *_ = PLACES[room]
    u, v, long, high, tint, _ = PLACES[other]
    left, right = max(x, u), min(x + width, u + long)
    ends = ((left + right) / 2,) * 2 if left < right else (x + width / 2, u + long / 2)
    arrow(axes, (ends[0], y), (ends[1], v + high + 0.02), color=TINTS[tint][1], width=1.6)


def first_words(file: Path) -> str:
    """First paragraph of a module's docstring, on one line."""
    words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(words.split("\n\n")[0].split())


def table() -> str:
    """Rooms and inner rooms, what they say of themselves, and whom they may import besides what is below all."""
    lines = ["| room | holds | may import |", "|---|---|---|"]
    for room, others in sorted(data()["imports"].items()):
        lines.append(line(f"**{room}**", f"{room}/__init__.py", ", ".join(others) or "no room"))
        for inner in sorted([*inner_rooms(room), *inner_files(room)]):
            names = sorted(name.removeprefix(f"{room}.") for name in INNER[f"{room}.{inner}"])
            file = f"{room}/{inner}/__init__.py" if inner in inner_rooms(room) else f"{room}/{inner}.py"
            lines.append(line(f"{room}/{inner}", file, ", ".join(names) or "none of its room"))
    for name in sorted({*ROOT, "device"}):
        file = f"{name}/__init__.py" if (PACKAGE / name).is_dir() else f"{name}.py"
        lines.append(line(f"**{name}**", file, ", ".join(sorted(ALLOWED[name])) or "nothing"))
    return "\n".join(lines)


def line(name: str, file: str, may_import: str) -> str:
    """A row of the table."""
    words = first_words(PACKAGE / file).replace("|", "\\|")
    return f"| [{name}](../otwarp/{file}) | {words} | {may_import} |"


def write() -> None:
    """Draw the picture, and put the table between the markers of docs/architecture.md."""
    save(draw(), NAME, data())
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
