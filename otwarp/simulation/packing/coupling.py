"""Coupled bodies of a scene as the arrays that kernels read, and what coupling does not go with."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.kernels.core.features import MAX_WORLD_BODIES
from otwarp.kernels.core.types import CouplingData
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import Place, device_array
from otwarp.simulation.packing.bodies import is_rigid


def takes_coupling(scene: Scene) -> bool:
    """Whether the bodies of a scene carry each other along: if it asks for that and there are several."""
    return scene.settings.coupling and len(scene.bodies) > 1


def check_coupling(scene: Scene) -> None:
    """Refuse coupling of too many bodies, or beside a wall.

    Raises:
        InputError: More than `MAX_WORLD_BODIES` bodies, or a hydrodynamic wall.
    """
    if not takes_coupling(scene):
        return
    where = f"{scene.file or scene.root}: {scene.root}: ot:scene:hydrodynamicCoupling = true: must be false"
    if len(scene.bodies) > MAX_WORLD_BODIES:
        raise InputError(f"{where} in a scene of {len(scene.bodies)} bodies; up to {MAX_WORLD_BODIES} can be coupled")
    walls = [o.prim for o in scene.obstacles if o.hydrodynamic]
    if walls:
        raise InputError(f"{where} beside {walls[0]}, whose ot:obstacle:hydrodynamic is true; one of the two can act")


def given_turning(move: BodyMobility) -> np.ndarray:
    """(3, 3) what a body's translations have beside its rotations, M_tt − M_tr M_rr⁻¹ M_rt = R_tt⁻¹ [1/µm]."""
    block = np.linalg.inv(move.resistance[:3, :3])
    return 0.5 * (block + block.T)


def coupling_radius(move: BodyMobility) -> float:
    """Radius of the sphere whose drag is the largest of the body in any direction [µm]."""
    return float(np.linalg.eigvalsh(move.resistance[:3, :3])[-1]) / (6.0 * np.pi)


def pack_coupling(scene: Scene, moves: list[BodyMobility], wanted: bool, device: Place) -> Annotated[Any, CouplingData]:
    """One row for each distinct mobility, in the order of `pack_bodies`; empty unless `wanted`."""
    distinct = list({id(m): m for m in moves}.values()) if wanted else []
    turning = distinct if any(is_rigid(b) for b in scene.bodies) else []
    data = device.typed(CouplingData)()
    data.radius = device_array([coupling_radius(m) for m in distinct], wp.float32, device)
    data.given_turning = device_array([given_turning(m) for m in turning], wp.mat33, device)
    ratio = [m.mobility[:3, 3:] @ np.linalg.inv(m.mobility[3:, 3:]) for m in turning]
    data.with_turning = device_array(ratio, wp.mat33, device)
    data.turning_root = device_array([np.linalg.cholesky(m.mobility[3:, 3:]) for m in turning], wp.mat33, device)
    return data
