"""Traps and medium of a scene as the arrays that kernels read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.kernels.core.types import MediumData, TrapData
from otwarp.kernels.optics.traps import trap_term
from otwarp.laws.trap_law import FIELDS, TrapLaw
from otwarp.scene import Scene, Trap
from otwarp.scene.transforms import rotate as rotate
from otwarp.simulation.packing.arrays import Place, device_array, device_rows
from otwarp.simulation.packing.commands import Samples, sampled_commands
from otwarp.simulation.packing.optics import TrapOptics, pack_exact, pack_tables, trap_sides
from otwarp.units import BOLTZMANN

_HANDS = {"none": 0, "left": 1, "right": 2}


def law(trap: Trap) -> TrapLaw:
    """The trap's radial law: authored, or resolved from its optics."""
    assert trap.radial is not None, "optical traps are resolved before they are packed"
    return trap.radial


def beam_axis(trap: Trap) -> np.ndarray:
    """(3,) direction in which the beam travels."""
    return rotate(np.array(trap.orientation), np.array([0.0, 0.0, 1.0]))


def equilibrium_points(scene: Scene, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """(1|W, T, 3) points where the forces of the traps vanish at the start [µm]."""
    along = [t.equilibrium * beam_axis(t) for t in scene.traps]
    return values["trap_position"] + np.array(along).reshape(-1, 3)


def axial_or_radial(scene: Scene, values: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """(1|W, T) law parameter `name` along the beam, which is the radial one where one isotropic curve serves."""
    split = np.array([t.axial is not None for t in scene.traps], dtype=bool)
    return np.where(split, values[f"trap_axial_{name}"], values[f"trap_{name}"])


def trap_reach(scene: Scene, values: Mapping[str, np.ndarray], radii: ArrayLike) -> np.ndarray:
    """Distance from the equilibrium point beyond which a sphere feels nothing of a trap [µm].

    Args:
        radii: Radius of the sphere, one for all traps or (T,) [µm].

    Returns:
        (1|W, T), inf for a law without an end.
    """
    fitted = np.array([law(t).radius for t in scene.traps])
    scale = np.where(fitted > 0.0, np.asarray(radii) / np.where(fitted > 0.0, fitted, 1.0), 1.0)
    return np.maximum(values["trap_cutoff"], axial_or_radial(scene, values, "cutoff")) * scale


def trap_places(scene: Scene) -> dict[str, np.ndarray]:
    """(1, T, 3) foci at the start [µm], by parameter name."""
    return {"trap_position": np.array([[t.position.at(0.0) for t in scene.traps]]).reshape(1, len(scene.traps), 3)}


def trap_parameters(scene: Scene) -> dict[str, np.ndarray]:
    """Per-trap parameters of the scene at the start, as `parameters.expand` makes them; forces per mW."""
    traps = scene.traps
    out = {
        **trap_places(scene),
        "trap_power": np.array([[t.power.at(0.0)[0] for t in traps]]),
        "trap_speed_limit": np.array([[t.speed_limit for t in traps]]),
    }
    for prefix, laws in (("trap_", [law(t) for t in traps]), ("trap_axial_", [t.axial or law(t) for t in traps])):
        per_mw = [curve.per_mw() for curve in laws]
        for name in FIELDS:
            out[prefix + name] = np.array([[getattr(curve, name) for curve in per_mw]], dtype=float)
    return out


@dataclass(frozen=True, eq=False)
class HeldSphere:
    """The sphere that a trap holds.

    Attributes:
        body: Its body, -1 for none.
        offset: (3,) from the body's reference point [µm].
        mobility: Mean over directions of its centre's mobility at unit viscosity [1/µm].
    """

    body: int
    offset: np.ndarray
    mobility: float


def pack_traps(
    scene: Scene,
    values: Mapping[str, np.ndarray],
    held: list[HeldSphere],
    held_range: np.ndarray,
    optics: TrapOptics,
    staged: list[Samples] | None,
    room: wp.array,
    device: Place,
) -> Annotated[Any, TrapData]:
    """Trap constants.

    Args:
        values: The `(1|W, T)` parameters, or `(1|R, T)` where worlds share rows.
        held: Per trap the sphere it holds.
        held_range: Likewise, distance at which that sphere has escaped [µm].
        optics: Force tables.
        staged: Commands as `staged_commands` has them.
        room: As `exact_room` has it.

    Raises:
        InputError: Curves across and along the beam that were fitted for spheres of different radii.
    """
    traps = scene.traps
    for trap in traps:
        if trap.axial and trap.axial.radius != law(trap).radius:
            raise InputError(
                f"{scene.file or scene.root}: {trap.prim}: ot:trapLaw:axial:radius = {trap.axial.radius:g} µm; "
                f"allowed: that of the radial curve, {law(trap).radius:g} µm"
            )
    data = device.typed(TrapData)()
    # curves along the beam and speed limits take memory only where some trap has one
    split = any(t.axial for t in traps)
    limits = bool(np.any(np.isfinite(values["trap_speed_limit"])))
    for name in FIELDS:
        setattr(data, name, device_rows(values[f"trap_{name}"], wp.float32, device, ndim=2))
        axial = values[f"trap_axial_{name}"] if split else np.zeros((0, 0))
        setattr(data, f"axial_{name}", device_rows(axial, wp.float32, device, ndim=2))
    data.speed_limit = device_rows(
        values["trap_speed_limit"] if limits else np.zeros((0, 0)), wp.float32, device, ndim=2
    )
    data.model = device_array([trap_term(optics.term_name(scene, t)).key for t in range(len(traps))], wp.int32, device)
    data.side = device_array(trap_sides(scene), wp.vec3, device)
    data.tables, data.near_nodes, data.near_grid = pack_tables(optics, [t.equilibrium for t in traps], device)
    data.exact = pack_exact(optics, room, device)
    data.exact_scale = device_array([t.beam.force_scale for t in optics.tables], wp.float32, device)
    data.axis = device_array([beam_axis(t) for t in traps], wp.vec3, device)
    data.equilibrium = device_array([t.equilibrium for t in traps], wp.float32, device)
    data.law_radius = device_array([law(t).radius for t in traps], wp.float32, device)
    data.hand = device_array([_HANDS[t.hand] for t in traps], wp.int32, device)
    data.held_body = device_array([h.body for h in held], wp.int32, device)
    data.held_offset = device_array([h.offset for h in held], wp.vec3, device)
    data.held_mobility = device_array([h.mobility for h in held], wp.float32, device)
    data.held_range = device_rows(held_range, wp.float32, device, ndim=2)
    data.key_start, data.key_time, data.key_value = _pack_samples(sampled_commands(scene), device)
    data.stage_start, data.stage_time, data.stage_value = _pack_samples(staged, device)
    return data


def _pack_samples(commands: list[Samples] | None, device: Place) -> tuple[wp.array, wp.array, wp.array]:
    """First sample of each trap, times and values of all; of length 0 without commands."""
    listed = commands or []
    start = [0, *np.cumsum([len(times) for times, _ in listed], dtype=int)] if commands is not None else []
    times = np.concatenate([np.zeros(0), *[times for times, _ in listed]])
    values = np.concatenate([np.zeros((0, 4)), *[values for _, values in listed]])
    return (
        device_array(start, wp.int32, device),
        device_array(times, wp.float64, device),
        device_array(values, wp.vec4, device),
    )


def pack_medium(temperature: np.ndarray, viscosity: np.ndarray, device: Place) -> Annotated[Any, MediumData]:
    """Thermal energy and viscosity from (1|W,) arrays."""
    data = device.typed(MediumData)()
    data.thermal_energy = device_rows(BOLTZMANN * temperature, wp.float32, device)
    data.viscosity = device_rows(viscosity, wp.float32, device)
    return data
