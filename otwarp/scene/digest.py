"""Content hash of a scene, by which a checkpoint knows what it was made of; a field added later changes none."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import numpy as np

from otwarp.scene.scene import Scene

BEGAN = {
    name: tuple(fields.split())
    for name, fields in {
        "Scene": "file root medium settings traps bodies obstacles flow camera goal",
        "Medium": "refractive_index viscosity temperature density",
        "Settings": "accuracy time_step integrator noise brownian gravity coupling duration frames_per_second",
        "Trap": "prim position power orientation wavelength numerical_aperture polarization model beam filling charge "
        "depth glass_index tolerance interpolation reach radial axial equilibrium hand speed_limit holds",
        "TrapLaw": "stiffness threshold inverse_square offset cutoff power radius",
        "Track": "times values",
        "Body": "prim instance kind position orientation spheres rods density material mobility mobility_accuracy "
        "warning_force",
        "Sphere": "prim offset radius refractive_index trapped collides drag",
        "Rod": "prim start end radius collides drag",
        "Material": "youngs_modulus poisson_ratio adhesion adhesion_range",
        "Obstacle": "prim shape position orientation size vertices triangles hydrodynamic",
        "Flow": "prim kind origin orientation speed shear_rate half_height",
        "Camera": "prim numerical_aperture condenser_aperture wavelength pixel_size focus noise",
        "Goal": "prim position cell robots tolerance lost_distance cell_lost_distance distance_warning",
    }.items()
}
"""Class of a scene's description → fields that it had when digests began: never to be changed. Every other field counts
only where it has not its default, so that a scene which does not use it keeps the digest that it had before."""


def scene_digest(scene: Scene) -> str:
    """SHA-256 of everything a scene says but the length of the run, which may be extended."""
    same = {"file": None, "remarks": (), "judged": False, "overrides": {}}  # what is no part of a scene's equality
    scene = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, duration=0.0), **same)
    with np.printoptions(threshold=2**31, floatmode="unique"):
        return hashlib.sha256(canonical(scene).encode()).hexdigest()


def canonical(item: object) -> str:
    """As `repr`, but for fields younger than `BEGAN` at their default."""
    if isinstance(item, tuple):
        return f"({', '.join(map(canonical, item))}{',' if len(item) == 1 else ''})"
    if not dataclasses.is_dataclass(item) or isinstance(item, type):
        return repr(item)
    values = {f.name: getattr(item, f.name) for f in dataclasses.fields(item) if f.repr and not is_unused(item, f)}
    return f"{type(item).__qualname__}({', '.join(f'{k}={canonical(v)}' for k, v in values.items())})"


def is_unused(item: object, f: dataclasses.Field[Any]) -> bool:
    """Whether a field is younger than digests and has its default."""
    if f.name in BEGAN.get(type(item).__name__, (f.name,)):
        return False
    default = f.default if f.default_factory is dataclasses.MISSING else f.default_factory()
    return default is not dataclasses.MISSING and bool(getattr(item, f.name) == default)
