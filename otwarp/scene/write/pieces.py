"""Pieces that scenes are made of, in one call each: a mesh, a robot with its traps, a cell."""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.appearance.palette import Color
from otwarp.scene.check.numbers import check_numbers
from otwarp.scene.description import IDENTITY, Body, Material, Quat, Sphere, Trap
from otwarp.scene.track import Track
from otwarp.scene.transforms import rotate
from otwarp.scene.write.into import OPACITY, mesh_obstacle
from otwarp.scene.write.mesh_file import Kind, Surface, read_surface

if TYPE_CHECKING:
    from pxr import Usd

SOFT = Material(youngs_modulus=1e3, poisson_ratio=0.45)
"""Of a cell."""


class Pieces:
    """What `SceneBuilder` can add besides single items."""

    @abstractmethod
    def add(self, item: Any, *, color: Color | None = None, opacity: float | None = None) -> Usd.Prim:
        """Author one item, see `SceneBuilder`."""

    def add_mesh(
        self,
        prim: str,
        mesh: Any,
        *,
        metres_per_unit: float = 1e-6,
        kind: Kind = "solid",
        position: Sequence[float] = (0.0, 0.0, 0.0),
        center: bool = False,
        simplify: int | None = None,
        color: Color | None = None,
        opacity: float | None = None,
    ) -> Surface:
        """Make a triangle mesh an obstacle at rest.

        Args:
            prim: Path of its prim.
            mesh: File (STL, OBJ, PLY), a `trimesh.Trimesh`, or (vertices, triangles).
            metres_per_unit: Length of a unit of the mesh [m].
            kind: `solid`, `chamber` (bodies belong into it) or `sheet` (thin, solid from both sides).
            position: Where its origin goes [µm].
            center: Whether the middle of its box is its origin.
            simplify: Reduce it to about that many triangles.
            color: Linear RGB.
            opacity: In [0, 1]; by default a chamber's lets see what is in it.

        Returns:
            What was read, with what was mended.

        Raises:
            InputError: As `mesh_file.read_surface` says, or the path is taken.
        """
        surface = read_surface(mesh, metres_per_unit=metres_per_unit, kind=kind, center=center, simplify=simplify)
        shown = OPACITY[kind] if opacity is None else opacity
        self.add(mesh_obstacle(prim, surface, position), color=color, opacity=shown)
        return surface

    def add_robot(
        self,
        prim: str,
        centres: Sequence[Sequence[float]] | np.ndarray,
        radii: float | Sequence[float],
        *,
        handles: Sequence[int] | None = None,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        orientation: Quat = IDENTITY,
        power: float = 0.0,
        path: Track | None = None,
        trap: Trap | None = None,
        color: Color | None = None,
        **body: Any,
    ) -> tuple[Trap, ...]:
        """Add a rigid robot of spheres `{prim}/sphere_0`, …, and a trap on each of its handles.

        Args:
            prim: Path of its prim.
            centres: (n, 3) centres of its spheres in its frame [µm].
            radii: Of all or of each [µm].
            handles: Which spheres traps act on; all of them by default.
            position: Of the robot's origin [µm].
            orientation: Of the robot.
            power: Of each trap [mW]; 0 for a robot without traps.
            path: How the robot is carried: displacement of all its traps over time [µm], such as
                `Track.line((0, 0, 0), (20, 0, 0), speed=10.0)`; None for traps at rest.
            trap: What else the traps are, place, power and prim apart; by default their forces come from exact tables.
            color: Linear RGB.
            body: Fields of `Body`: density, material, mobility, ….

        Returns:
            Its traps, `{prim}_trap_{k}` on sphere k.

        Raises:
            InputError: Spheres, radii and handles that do not fit each other, or a path that is taken.
        """
        places = np.asarray(centres, dtype=float)
        sizes = np.broadcast_to(np.asarray(radii, dtype=float), places.shape[:1])
        held = range(len(places)) if handles is None else handles
        if places.ndim != 2 or places.shape[1] != 3 or not len(places):
            raise InputError(f"SceneBuilder: {prim}: centres = shape {places.shape}: must be (n, 3), n ≥ 1")
        for k in held:
            if not (isinstance(k, (int, np.integer)) and 0 <= k < len(places)):
                raise InputError(
                    f"SceneBuilder: {prim}: handles = {k}: must be numbers of spheres, 0 to {len(places) - 1}"
                )
        spheres = tuple(
            Sphere(
                prim=f"{prim}/sphere_{k}", offset=_vector(prim, "centres", c), radius=float(r), trapped=k in set(held)
            )
            for k, (c, r) in enumerate(zip(places, sizes, strict=True))
        )
        robot = Body(
            prim=prim, position=_vector(prim, "position", position), orientation=orientation, spheres=spheres, **body
        )
        self.add(robot, color=color)
        return tuple(self._trap_on(robot, k, power, path, trap) for k in held if power > 0.0)

    def _trap_on(self, robot: Body, k: int, power: float, path: Track | None, trap: Trap | None) -> Trap:
        """Add the trap that holds sphere k."""
        there = np.asarray(robot.position) + rotate(
            np.asarray(robot.orientation), np.asarray([robot.spheres[k].offset])
        )
        way = Track.constant((0.0, 0.0, 0.0)) if path is None else path
        made = dataclasses.replace(
            trap or Trap(prim="", position=way, power=way, model="table"),
            prim=f"{robot.prim}_trap_{k}",
            position=way.shifted(there[0]),
            power=Track.constant(power),
            holds=robot.spheres[k].prim,
        )
        self.add(made)
        return made

    def add_cell(
        self,
        prim: str,
        position: Sequence[float],
        radius: float,
        *,
        material: Material = SOFT,
        index: float = 1.38,
        density: float = 1060e-12,
        color: Color = (0.45, 0.65, 0.85),
        **body: Any,
    ) -> Usd.Prim:
        """Add a cell: a soft sphere that no trap holds.

        Args:
            prim: Path of its prim.
            position: Its centre [µm].
            radius: [µm].
            material: Its surface.
            index: Its refractive index.
            density: [pN·s²/µm⁴].
            color: Linear RGB.
            body: Other fields of `Body`.

        Raises:
            InputError: The path is taken.
        """
        sphere = Sphere(prim=prim, radius=radius, refractive_index=index, trapped=False)
        cell = Body(
            prim=prim,
            kind="cell",
            position=_vector(prim, "position", position),
            spheres=(sphere,),
            material=material,
            density=density,
            **body,
        )
        return self.add(cell, color=color)


def _vector(prim: str, name: str, values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Three plain floats."""
    x, y, z = check_numbers("SceneBuilder", prim, name, values, (3,)).tolist()
    return x, y, z
