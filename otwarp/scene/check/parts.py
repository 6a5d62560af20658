"""Traps, bodies and obstacles, each by itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene import vocabulary
from otwarp.scene.check.fields import check_fields
from otwarp.scene.check.numbers import (
    check_length,
    check_numbers,
    check_places,
    check_track,
    check_turns,
)
from otwarp.scene.description import Body, Material, Medium, Obstacle, Rod, Sphere, Trap
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.vocabulary.values import authored, bad, check

_UNITS = {"length_unit": 1e-6, "force_unit": 1e-12}


def check_trap(where: str, trap: Trap, medium: Medium) -> None:
    """Refuse a trap that no file could say, or whose beam cannot be.

    Raises:
        InputError: One line.
    """
    prim = trap.prim
    check_track(where, prim, "position", trap.position, 3)
    check_track(where, prim, "power", trap.power, 1)
    for power in (trap.power.values.min(), trap.power.values.max()):
        check(where, prim, "ot:trap:power", vocabulary.TRAP["power"], authored(power, "power"))
    turn = check_numbers(where, prim, "orientation", trap.orientation, (4,))
    check_turns(where, [prim], "orientation", turn[None])
    check_fields(where, prim, vocabulary.TRAP, trap, skip=("power",))
    _check_beam(where, trap, medium)
    if trap.radial is None and (trap.axial is not None or not trap.optical):
        needed = "beside an axial one" if trap.axial is not None else f"with ot:trap:model = {trap.model}"
        raise bad(where, prim, "radial", None, f"a TrapLaw {needed}")
    instances = ("isotropic",) if trap.axial is None else ("radial", "axial")
    for instance, law in zip(instances, (trap.radial, trap.axial), strict=False):
        if law is not None:
            check_law(where, prim, instance, law)


def check_law(where: str, prim: str, instance: str, law: Any) -> None:
    """Refuse a force curve with a constant that no file could say."""
    if not isinstance(law, TrapLaw):
        raise bad(where, prim, instance, repr(law), "a TrapLaw")
    power = authored(law.power, "power") if isinstance(law.power, int | float) else law.power
    values = vars(law) | _UNITS | {"power": power}
    check_fields(where, prim, vocabulary.TRAP_LAW, values, instance=instance, si=True)


def _check_beam(where: str, trap: Trap, medium: Medium) -> None:
    aperture, index, glass = trap.numerical_aperture, medium.refractive_index, trap.glass_index
    if not aperture < index:
        limit = (
            f"in (0, {index:g}), below the refractive index of the medium (an aperture of"
            f" {aperture:g} needs an immersion medium of index above {aperture:g})"
        )
        raise bad(where, trap.prim, "ot:trap:numericalAperture", aperture, limit)
    if trap.depth > 0.0 and glass is None:
        limit = "0 m while ot:trap:glassIndex = 0; a depth above 0 needs the index of the glass, in [1, 4]"
        raise bad(where, trap.prim, "ot:trap:depth", authored(trap.depth, "length"), limit)
    if glass is not None and glass <= aperture:
        limit = f"above the numerical aperture, {aperture:g}, or 0 for no interface"
        raise bad(where, trap.prim, "ot:trap:glassIndex", glass, limit)


def check_bodies(where: str, bodies: Sequence[Body]) -> None:
    """Refuse a body that no file could say; equal materials and spheres of many cells are judged once.

    Raises:
        InputError: One line.
    """
    known: set[Any] = set()
    for body in bodies:
        if body.kind not in ("robot", "cell"):
            raise bad(where, body.name, "kind", repr(body.kind), "one of robot, cell")
        if not isinstance(body.material, Material):
            raise bad(where, body.name, "material", repr(body.material), "a Material")
        _check_elements(where, body, known)
        shared = (body.spheres[0], body.material, body.forces, body.density, body.mobility, body.mobility_accuracy)
        alike = (body.kind, *map(id, (*shared, body.warning_force)))
        if alike not in known:
            known.add(alike)
            schema = vocabulary.CELL if body.kind == "cell" else vocabulary.BODY
            check_fields(where, body.name, schema, body, sphere=body.spheres[0])
    names = [body.name for body in bodies]
    for name, width, judge in (("position", 3, check_places), ("orientation", 4, check_turns)):
        values = [getattr(body, name) for body in bodies]
        if not all(isinstance(value, tuple) and [*map(type, value)] == [float] * width for value in values):
            values = [
                check_numbers(where, path, name, value, (width,)) for path, value in zip(names, values, strict=True)
            ]
        rows = np.array(values, dtype=float).reshape(-1, width)
        if not np.isfinite(rows).all():
            which = int(np.argmin(np.isfinite(rows).all(axis=1)))
            check_numbers(where, names[which], name, rows[which], (width,))
        judge(where, names, name, rows)


def _check_elements(where: str, body: Body, known: set[Any]) -> None:
    """Spheres and rods of a body; `known` holds what was judged."""
    for name in ("spheres", "rods"):
        if not isinstance(getattr(body, name), Sequence):
            kind = "Sphere" if name == "spheres" else "Rod"
            raise bad(where, body.name, name, f"a {type(getattr(body, name)).__name__}", f"a tuple of {kind}")
    if not body.spheres:
        raise bad(where, body.name, "spheres", "()", "at least one Sphere")
    for element in (*body.spheres, *body.rods):
        if id(element) in known:
            continue
        known.add(id(element))
        if not isinstance(element, Sphere | Rod):
            raise bad(where, body.name, "spheres, rods", repr(element), "Sphere and Rod")
        check_length(where, element.prim, "radius", element.radius)
        rod = isinstance(element, Rod)
        for name in ("start", "end") if rod else ("offset",):
            place = check_numbers(where, element.prim, name, getattr(element, name), (3,))
            check_places(where, [element.prim], name, place[None])
        check_fields(where, element.prim, vocabulary.ROD if rod else vocabulary.SPHERE, element)


_SIZES = {"plane": 0, "mesh": 0, "box": 3, "sphere": 1}
"""Components of a size that say something, of shapes that are not round solids."""


def check_obstacle(where: str, obstacle: Obstacle) -> None:
    """Refuse an obstacle that no file could say.

    Raises:
        InputError: One line.
    """
    prim, shape = obstacle.prim, obstacle.shape
    if shape not in SHAPES:
        raise bad(where, prim, "shape", repr(shape), f"one of {', '.join(SHAPES)}")
    check_track(where, prim, "position", obstacle.position, 3)
    check_track(where, prim, "orientation", obstacle.orientation, 4)
    size = check_numbers(where, prim, "size", obstacle.size, (3,))
    for n in range(_SIZES.get(shape, 2)):
        check_length(where, prim, f"size[{n}]", float(size[n]), zero=shape == "capsule" and n == 1)
    if shape == "mesh":
        _check_mesh(where, obstacle)
    check_fields(where, prim, vocabulary.OBSTACLE, obstacle)
    if obstacle.hydrodynamic and shape != "plane":
        raise bad(where, prim, "ot:obstacle:hydrodynamic", True, f"false on a {SHAPES[shape].usd}, true on a Plane")
    if obstacle.hydrodynamic and (obstacle.position.animated or obstacle.orientation.animated):
        raise bad(where, prim, "ot:obstacle:hydrodynamic", True, "false on an obstacle that moves")


def _check_mesh(where: str, obstacle: Obstacle) -> None:
    vertices = check_numbers(where, obstacle.prim, "vertices", obstacle.vertices, (-1, 3))
    triangles = check_numbers(where, obstacle.prim, "triangles", obstacle.triangles, (-1, 3))
    check_places(where, [obstacle.prim] * len(vertices), "vertices", vertices)
    if not len(triangles) or np.asarray(obstacle.triangles).dtype.kind not in "iu":
        shown = f"{len(triangles)} of type {np.asarray(obstacle.triangles).dtype}"
        raise bad(where, obstacle.prim, "triangles", shown, "whole numbers, at least one triangle")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        shown = f"{triangles.min():g} … {triangles.max():g}"
        raise bad(where, obstacle.prim, "triangles", shown, f"in [0, {len(vertices) - 1}]")
