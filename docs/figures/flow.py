"""The way of the data: what becomes of a scene, in a run and live; each box names the code that it stands for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from docs.figures.style import INK, QUIET, TINTS, arrow, box, canvas, save, text

NAME = "architecture_flow"
SIZE = (11.0, 6.35)


@dataclass(frozen=True)
class Node:
    """A box.

    Attributes:
        code: `module:name` of what it stands for; empty for things outside of the package.
        at: Lower left corner [in].
        size: Width and height [in].
        tint: Its colour.
        title, about: What it says.
    """

    code: str
    at: tuple[float, float]
    size: tuple[float, float]
    tint: str
    title: str
    about: str = ""


TALL, LOW = 0.85, 0.62
NODES = {
    "usd": Node("", (0.25, 5.05), (1.5, TALL), "grey", "USD stage", "by hand, or by\nSceneBuilder"),
    "scene": Node(
        "otwarp:Scene",
        (2.35, 5.05),
        (1.75, TALL),
        "blue",
        "Scene",
        "plain numbers: bodies,\ntraps, flow, obstacles",
    ),
    "tables": Node("otwarp.optics:ForceTable", (4.75, 5.53), (1.6, LOW), "blue", "ForceTable", "exact forces, cached"),
    "mobility": Node(
        "otwarp.hydrodynamics:BodyMobility",
        (4.75, 4.8),
        (1.6, LOW),
        "blue",
        "BodyMobility",
        "surface blobs, cached",
    ),
    "model": Node(
        "otwarp.simulation:Model",
        (7.0, 5.05),
        (1.6, TALL),
        "red",
        "Model",
        "arrays on the device,\ntime step, features",
    ),
    "step": Node(
        "otwarp.kernels.step:make_step",
        (9.15, 5.05),
        (1.6, TALL),
        "blue",
        "step",
        "one kernel, made\nfor these features",
    ),
    "control": Node("otwarp.simulation:Control", (4.75, 3.59), (1.6, LOW), "red", "Control", "traps as commanded"),
    "sim": Node(
        "otwarp:Simulation",
        (7.0, 3.59),
        (3.75, LOW),
        "red",
        "Simulation",
        "State of all worlds, step after step, on CPU or GPU",
    ),
    "readout": Node(
        "otwarp.simulation:Readout", (7.0, 1.95), (1.6, TALL), "red", "Readout", "forces, distances,\nescapes"
    ),
    "recorder": Node(
        "otwarp.record.recorder:Recorder", (9.15, 1.95), (1.6, TALL), "violet", "Recorder", "frames, task,\nstatistics"
    ),
    "run": Node("", (9.15, 0.3), (1.6, TALL), "grey", "run folder", "run.usda, run.nc,\nsummary, figure"),
    "preview": Node(
        "otwarp.preview.draw:", (7.0, 0.3), (1.6, TALL), "violet", "preview", "pictures and movies\nwithout a display"
    ),
    "loop": Node(
        "otwarp.teleop.session.live:",
        (4.75, 0.3),
        (1.6, 2.71),
        "amber",
        "live loop",
        "in pace with the clock,\n120 ticks a second",
    ),
    "page": Node("otwarp.teleop.page:PageProcess", (2.35, 2.39), (1.75, LOW), "amber", "page", "in the browser"),
    "servo": Node("otwarp.haptics.servo:", (2.35, 1.69), (1.75, LOW), "green", "servo", "1 kHz, signal chain"),
    "device": Node("otwarp.haptics.devices:", (0.25, 1.69), (1.5, LOW), "green", "device", "moved and felt"),
    "ros": Node("otwarp.ros:", (2.35, 0.99), (1.75, LOW), "amber", "ROS 1, ROS 2", "topics, no installation"),
    "mcap": Node("otwarp.teleop.recording:", (2.35, 0.3), (1.75, LOW), "grey", "recording", ".mcap, replayed exactly"),
}
"""Name → box; `module:` stands for the module itself."""

EDGES = [
    ("usd", "scene"),
    ("scene", "tables"),
    ("scene", "mobility"),
    ("tables", "model"),
    ("mobility", "model"),
    ("model", "step"),
    ("model", "sim"),
    ("step", "sim"),
    ("control", "sim"),
    ("sim", "readout"),
    ("readout", "recorder"),
    ("recorder", "run"),
    ("run", "preview"),
    ("readout", "loop"),
    ("loop", "control"),
    ("loop", "page"),
    ("loop", "servo"),
    ("servo", "device"),
    ("loop", "ros"),
    ("loop", "mcap"),
]
BOTH = {("loop", "page"), ("loop", "servo"), ("servo", "device"), ("loop", "ros")}
"""Edges along which data go both ways."""


def data() -> dict[str, Any]:
    """What the picture shows."""
    return {
        "nodes": {name: [node.title, node.about, node.code] for name, node in NODES.items()},
        "edges": [list(edge) for edge in EDGES],
    }


def ends(start: Node, end: Node) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where an arrow leaves and arrives: sides that face each other, at heights that they share."""
    (x, y), (w, h) = start.at, start.size
    (u, v), (p, q) = end.at, end.size
    if u >= x + w or x >= u + p:
        low, high = max(y, v), min(y + h, v + q)
        level = (low + high) / 2 if low < high else None
        out = (x + w if u > x else x, level if level is not None else y + h / 2)
        return out, (u if u > x else u + p, level if level is not None else v + q / 2)
    middle = (max(x, u) + min(x + w, u + p)) / 2
    return (middle, y if v < y else y + h), (middle, v + q if v < y else v)


def draw() -> Any:
    """The figure."""
    figure, axes = canvas(*SIZE)
    for node in NODES.values():
        (x, y), (w, h) = node.at, node.size
        box(axes, x, y, w, h, node.tint)
        text(axes, x + w / 2, y + h - 0.2, node.title, size=11, weight="bold", ha="center", color=TINTS[node.tint][1])
        text(axes, x + w / 2, y + h - 0.36, node.about, size=8.4, ha="center", va="top", color=INK, linespacing=1.35)
    for start, end in EDGES:
        arrow(axes, *ends(NODES[start], NODES[end]), both=(start, end) in BOTH, color=QUIET)
    return figure


def write() -> None:
    """Draw the picture."""
    save(draw(), NAME, data())
