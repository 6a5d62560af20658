"""Reads one world of a recorded run back from `run.nc`, thinned to what a figure can show."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.record.method import Method
from otwarp.record.monitor import robot_distance

MOST_BODIES = 24
"""Up to so many bodies outside the task are followed in time."""

MOST_POINTS = 4000
"""A run with more frames is thinned to at most twice this many."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One world of a recorded run, n frames.

    Attributes:
        title: Name of the scene.
        layout: Obstacles, goal, warning lines, as JSON gave them.
        time_step: [s].
        method: How the run was computed; None in a file that does not say.
        time: (n,) [s].
        robots, cells, others: Columns of the followed bodies in the arrays below.
        names: Short names of the followed bodies.
        radius: (b,) radius of the largest sphere of each [µm].
        spheres: Per followed body (k, 4) offsets and radii of its spheres [µm].
        rods: Per followed body (k, 7) both ends and radii of its rods [µm]; none in a file of an earlier version.
        jumped: (n, b) whether a body came in on another side since the frame before, where space repeats or has inlets.
        world, worlds: Which of how many recorded worlds.
        position: (n, b, 3) [µm].
        orientation: (n, b, 4) quaternions (x, y, z, w).
        force: (n, b, 3) net contact force [pN].
        load: (n, b) sum of normal forces [pN].
        distance: (n, robots) robot–trap distance [µm]; no columns without traps.
        rest: (m, 3) where the bodies end that are too many to be followed [µm], and `rest_radius` (m,).
    """

    title: str
    layout: dict[str, Any]
    time_step: float
    method: Method | None
    time: np.ndarray
    robots: list[int]
    cells: list[int]
    others: list[int]
    names: list[str]
    radius: np.ndarray
    spheres: list[np.ndarray]
    rods: list[np.ndarray]
    jumped: np.ndarray
    world: int
    worlds: int
    position: np.ndarray
    orientation: np.ndarray
    force: np.ndarray
    load: np.ndarray
    distance: np.ndarray
    rest: np.ndarray
    rest_radius: np.ndarray


def read_run(file: Path, world: int = 0) -> Run:
    """Read one world of `run.nc`.

    Args:
        file: The netCDF file of a recorded run.
        world: Which of its recorded worlds, counted from 0.

    Returns:
        Its frames, every n-th where there are more than `MOST_POINTS`.

    Raises:
        InputError: No such file, or no such world or frame in it.
    """
    import netCDF4

    if not file.is_file():
        raise InputError(f"{file}: file = missing; allowed: the netCDF file of a recorded run")
    try:
        data = netCDF4.Dataset(file)
    except OSError as error:
        raise InputError(f"{file}: contents = {error.strerror}; allowed: the netCDF file of a recorded run") from None
    with data:
        data.set_auto_mask(False)
        frames, worlds = len(data.dimensions["frame"]), len(data.dimensions["world"])
        if not 0 <= world < worlds:
            raise InputError(f"{file}: world = {world}; allowed: 0 … {worlds - 1}")
        if not frames:
            raise InputError(f"{file}: frames = 0; allowed: 1 or more")
        return _read(data, world, slice(0, frames, max(1, frames // MOST_POINTS)))


def _read(data: Any, world: int, pick: slice) -> Run:
    layout = json.loads(data.layout)
    time = np.asarray(data["time"][pick])
    count = len(data.dimensions["body"]) if "body" in data.dimensions else 0
    robots, cells = layout["robots"], layout["cells"]
    others = sorted(set(range(count)) - {*robots, *cells})
    others, rest = (others, []) if len(others) <= MOST_BODIES else ([], others)
    followed = [*robots, *cells, *others]

    def series(name: str, *shape: int) -> np.ndarray:
        columns = [np.asarray(data[name][pick, world, body], dtype=float) for body in followed]
        return np.stack(columns, axis=1) if columns else np.zeros((len(time), 0, *shape))

    distance = np.zeros((len(time), 0))
    if "trap" in data.dimensions:
        holder = data["trap_body"][:]
        traps_of = [np.flatnonzero(holder == r) for r in robots]
        distance = robot_distance(data["trap_distance"][pick, world], data["trap_power"][pick, world], traps_of)
    radius = np.asarray(data["body_radius"][:]) if count else np.zeros(0)
    last = np.asarray(data["position"][-1, world], dtype=float) if count else np.zeros((0, 3))
    return Run(
        title=data.scene,
        layout=layout,
        time_step=float(data.time_step),
        method=Method.read(data.__dict__),
        time=time,
        robots=list(range(len(robots))),
        cells=list(range(len(robots), len(robots) + len(cells))),
        others=list(range(len(robots) + len(cells), len(followed))),
        names=[str(data["body"][body]).rsplit("/", 1)[-1] for body in followed],
        radius=radius[followed],
        spheres=[_spheres(layout, body, float(radius[body])) for body in followed],
        rods=[np.array((layout.get("rods") or {body: []})[body]).reshape(-1, 7) for body in followed],
        jumped=_jumped(data, pick, world, followed, len(time)),
        world=world,
        worlds=len(data.dimensions["world"]),
        position=series("position", 3),
        orientation=series("orientation", 4),
        force=series("contact_force", 3),
        load=series("contact_load"),
        distance=distance,
        rest=last[rest],
        rest_radius=radius[rest],
    )


def _jumped(data: Any, pick: slice, world: int, followed: list[int], frames: int) -> np.ndarray:
    """(frames, followed) whether a body came in on another side since the frame before."""
    out = np.zeros((frames, len(followed)), dtype=bool)
    for n, body in enumerate(followed):
        if "unwrapped" in data.variables:
            periods = np.asarray(data["unwrapped"][pick, world, body]) - data["position"][pick, world, body]
            out[1:, n] |= np.any(np.abs(np.diff(periods, axis=0)) > 1e-2, axis=1)
        if "entries" in data.variables:
            out[1:, n] |= np.diff(data["entries"][pick, world, body]) != 0
    return out


def _spheres(layout: dict[str, Any], body: int, radius: float) -> np.ndarray:
    """(k, 4) spheres of a body; in a many-body scene, one sphere stands for it."""
    listed = layout["spheres"]
    return np.array(listed[body]) if listed is not None else np.array([[0.0, 0.0, 0.0, radius]])
