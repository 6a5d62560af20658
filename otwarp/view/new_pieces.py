"""Robots and meshes for a scene that is drawn: several prims each, added as one edit."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene, SceneBuilder, Track, Trap
from otwarp.scene.appearance.palette import ROBOTS as COLORS
from otwarp.scene.appearance.palette import Color
from otwarp.scene.write.edit import StageEditor
from otwarp.scene.write.into import COLOR, OPACITY, mesh_obstacle
from otwarp.scene.write.mesh_file import Kind, Surface, read_surface
from otwarp.teleop.page.compose import compose, display
from otwarp.view.new_items import LAW, POWER

ROBOTS: dict[str, tuple[tuple[tuple[float, float, float], ...], tuple[int, ...]]] = {
    "pair": (((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), (0, 1)),
    "row of 4": (tuple((2.0 * k - 3.0, 0.0, 0.0) for k in range(4)), (0, 3)),
    "triangle": (((1.1547, 0.0, 0.0), (-0.57735, 1.0, 0.0), (-0.57735, -1.0, 0.0)), (0, 1, 2)),
    "cross of 5": (
        ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, -2.0, 0.0)),
        (1, 2, 3, 4),
    ),
}
"""Centres of touching spheres over their radius, and those that traps hold."""


def add_robot(editor: StageEditor, shape: str, place: Sequence[float], radius: float) -> str:
    """Add a robot of equal spheres, with a trap on each of its ends.

    The traps have the law and the power of the scene's first one, or a spring where it has none.

    Args:
        editor: The scene.
        shape: Of `ROBOTS`.
        place: Of its middle [µm].
        radius: Of its spheres [µm].

    Returns:
        Its path.

    Raises:
        InputError: A radius that is not above 0, or the scene could not be loaded with it.
    """
    if not radius > 0.0:
        raise InputError(f"size = {radius:g} µm: must be above 0")
    scene, path = editor.scene, editor.free_path("robot")
    centres, ends = ROBOTS[shape]
    origin = Track.constant((0.0, 0.0, 0.0))
    trap, power = Trap(prim="", position=origin, power=origin, model="harmonic", radial=LAW), POWER
    if scene.traps:
        trap, power = dataclasses.replace(scene.traps[0], hand="none"), float(scene.traps[0].power.at(0.0)[0])
    traps = [f"{path}_trap_{k}" for k in ends]
    color = _own_color(scene)

    def write(builder: SceneBuilder) -> None:
        """The robot and its traps."""
        builder.add_robot(
            path,
            np.round(radius * np.array(centres), 6),
            radius,
            handles=ends,
            position=[round(float(v), 6) for v in place],
            power=power,
            trap=trap,
            color=color,
        )

    editor.author([path, *traps], write)
    return path


def read_mesh(name: str, content: bytes, micrometres: float, kind: Kind) -> Surface:
    """A mesh that a browser sent, with the middle of its box as its origin.

    Args:
        name: Of the file, whose ending says what it is.
        content: Of the file.
        micrometres: Length of its unit [µm].
        kind: What its surface bounds.

    Raises:
        InputError: As `read_surface`, naming the file.
    """
    with tempfile.TemporaryDirectory(prefix="otwarp-mesh-") as folder:
        file = Path(folder) / f"mesh{Path(name).suffix.lower()}"
        file.write_bytes(content)
        try:
            return read_surface(file, metres_per_unit=1e-6 * micrometres, kind=kind, center=True)
        except InputError as error:
            raise InputError(str(error).replace(str(file), name)) from None


def add_mesh(editor: StageEditor, surface: Surface, place: Sequence[float]) -> str:
    """Add a mesh as an obstacle.

    Args:
        editor: The scene.
        surface: The mesh.
        place: Of its origin [µm].

    Returns:
        Its path.

    Raises:
        InputError: The scene could not be loaded with it.
    """
    path = editor.free_path("mesh")
    obstacle = mesh_obstacle(path, surface, [round(float(v), 6) for v in place])
    editor.author([path], lambda builder: builder.add(obstacle, color=COLOR, opacity=OPACITY[surface.kind]))
    return path


def _own_color(scene: Scene) -> Color:
    """The colour of robots that is farthest from those that bodies have."""
    drawing = compose(scene)
    there = [part.colour for body in drawing.bodies for part in body.parts]
    there += [tuple(colour) for group in drawing.balls for colour in np.atleast_2d(group.colours)]
    return max(
        COLORS, key=lambda color: min((np.linalg.norm(np.subtract(display(color), c)) for c in there), default=0)
    )
