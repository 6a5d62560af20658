"""What a scene holds and how it would be stepped, as plain data: the answer behind `otwarp info`."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.terms import terms
from otwarp.scene import Scene
from otwarp.simulation.drivers.compilation import kernel_memory
from otwarp.simulation.drivers.grid_scratch import allocate_grid, allocate_push
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.packing.traps import axial_or_radial, law, trap_reach
from otwarp.simulation.state import Control, Readout, State
from otwarp.units import BOLTZMANN
from otwarp.warp_internals import fields, is_struct


def device_bytes(model: Model, *groups: Any) -> int:
    """Bytes of device memory held by the model's tables and the arrays of `groups` (State, Control, Readout)."""
    arrays = [v for group in groups for v in vars(group).values() if isinstance(v, wp.array)]
    data = model.data
    for part in (
        data.medium,
        data.traps,
        data.body,
        data.contact,
        data.obstacles,
        data.flow,
        data.walls,
        data.coupling,
        *model.force_data,
    ):
        arrays += [v for v in fields(part).values() if isinstance(v, wp.array)]
    arrays += [data.traps.tables.node, model.exact_room]
    return sum(a.capacity for a in arrays)


def struct_bytes(data: Any) -> int:
    """Bytes of the arrays of a struct, and of the structs in it."""
    size = 0
    for value in fields(data).values():
        size += value.capacity if isinstance(value, wp.array) else struct_bytes(value) if is_struct(value) else 0
    return size


def _bytes_per_world(model: Model, groups: tuple[State, Control, Readout]) -> dict[str, int]:
    """Bytes that each further world takes: of state, command and readout, and of the grid driver's scratch."""
    held = sum(v.capacity for g in groups for v in vars(g).values() if isinstance(v, wp.array))
    scratch = 0
    if model.features.driver == "grid":
        scratch = struct_bytes(allocate_grid(model, groups[0])) + 2 * struct_bytes(allocate_push(model))
    return {"state": held // model.worlds, "scratch": scratch // model.worlds}


def _kernels(model: Model, *, compiled: bool) -> list[dict[str, Any]] | None:
    """Registers and local memory of the kernels of the step."""
    step = kernel_module("step", model.features.precision).make_step(model.features)
    rows = kernel_memory(step.kernels, model.device, load=compiled)
    return None if rows is None else [dataclasses.asdict(row) for row in rows]


def _finite(value: float | None) -> float | None:
    """The value, or None where it is infinite or nan, which JSON cannot say."""
    return None if value is None or not math.isfinite(value) else float(value)


def _bodies(scene: Scene) -> list[dict[str, Any]]:
    """One row per distinct body: instances of a PointInstancer count once."""
    energy_over_viscosity = BOLTZMANN * scene.medium.temperature / scene.medium.viscosity
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for body, move in zip(scene.bodies, mobilities(scene), strict=True):
        key = (body.prim, id(move))
        if key in rows:
            rows[key]["count"] += 1
            continue
        rows[key] = {
            "name": body.prim,
            "kind": body.kind,
            "count": 1,
            "spheres": len(body.spheres),
            "rods": len(body.rods),
            "trapped": sum(s.trapped for s in body.spheres),
            "colliding": len(body.colliding),
            "translational_diffusion": energy_over_viscosity * float(np.trace(move.mobility[:3, :3])) / 3.0,
            "rotational_diffusion": energy_over_viscosity * float(np.trace(move.mobility[3:, 3:])) / 3.0,
        }
    return list(rows.values())


def _traps(model: Model) -> list[dict[str, Any]]:
    """One row per trap, at its power at the start of world 0 and for the sphere it holds."""
    scene, values = model.scene, model.values
    spheres = [scene.bodies[b].spheres[i] if b >= 0 else None for b, i in model.held]
    radii = np.array([s.radius if s else (law(t).radius or 1.0) for t, s in zip(scene.traps, spheres, strict=True)])
    reach, axial = trap_reach(scene, values, radii)[0], axial_or_radial(scene, values, "stiffness")[0]
    rows = []
    for t, (trap, sphere) in enumerate(zip(scene.traps, spheres, strict=True)):
        power = float(values["trap_power"][0, t])
        scale = power * (law(trap).radius / radii[t] if law(trap).radius > 0.0 else 1.0)
        rows.append(
            {
                "name": trap.prim,
                "model": model.optics.term_name(scene, t),
                "power": power,
                "radial_stiffness": float(values["trap_stiffness"][0, t] * scale),
                "axial_stiffness": float(axial[t] * scale),
                "reach": _finite(reach[t]),
                "hand": trap.hand,
                "animated": trap.position.animated or trap.power.animated,
                "holds": sphere.prim if sphere else None,
            }
        )
    return rows


def _optics(model: Model) -> list[dict[str, Any]]:
    """One row per beam and kind of sphere whose force is computed: forces at 1 mW, and how well they are known."""
    rows, seen = [], set()
    for t, trap in enumerate(model.scene.traps):
        for k, (radius, index) in enumerate(model.optics.kinds):
            number = int(model.optics.table[t, k])
            if number < 0:
                continue
            if (number, trap.model) in seen:
                continue
            seen.add((number, trap.model))
            table = model.optics.tables[number]
            about = table.properties
            sharing = [
                other.prim
                for i, other in enumerate(model.scene.traps)
                if model.optics.table[i, k] == number and other.model == trap.model
            ]
            rows.append(
                {
                    "traps": sharing,
                    "model": trap.model,
                    "radius": radius,
                    "index": index,
                    "stiffness": list(about.stiffness) if about else None,
                    "steepest": table.steepest,
                    "equilibrium": about.equilibrium if about else None,
                    "escape_force": list(about.escape_force) if about else None,
                    "escape_distance": [_finite(d) for d in about.escape_distance] if about else None,
                    "cutoff": table.cutoff,
                    "beyond": table.beyond,
                    "table_error": table.error,
                    "tolerance": table.tolerance,
                    "interpolation": table.interpolation,
                    "bytes": table.size,
                }
            )
    return rows


def _forces(model: Model) -> list[dict[str, Any]]:
    """One row per force with parameters: these, where it acts, and what it does at most to a body at rest."""
    active, rows = model.forces, []
    for index, force in enumerate(active.body_forces):
        acting = np.flatnonzero(active.acts[index])
        values = active.parameters_of(index)
        rows.append(
            {
                "name": force.name,
                "acts_on": force.acts_on,
                "bodies": [model.scene.bodies[b].name for b in acting],
                "parameters": {
                    p.name: {
                        "unit": p.unit,
                        "low": values[p.name][:, acting].min(axis=(0, 1)).tolist(),
                        "high": values[p.name][:, acting].max(axis=(0, 1)).tolist(),
                    }
                    for p in force.parameters
                },
                "digest": force.digest,
                "bounds": "measured" if force.load is None or force.slope is None else "stated",
            }
        )
    return rows


def _flow(scene: Scene) -> dict[str, Any] | None:
    """The flow, and of a velocity field its size and how much liquid appears or vanishes in it."""
    flow = scene.flow
    if flow is None:
        return None
    about: dict[str, Any] = {"name": flow.prim, "kind": flow.kind}
    if flow.field is not None:
        relative, largest = flow.field.divergence
        about |= {
            "file": flow.file,
            "nodes": list(flow.field.nodes),
            "low": list(flow.field.low),
            "high": flow.field.high.tolist(),
            "fastest": flow.field.fastest,
            "divergence": relative,
            "largest_divergence": largest,
        }
    return about


def _loads(model: Model) -> dict[str, float]:
    """The most that forces other than traps do to any body: force [pN], torque [pN·µm], relaxation rate [1/s]."""
    viscosity = float(model.values["medium_viscosity"].min())
    return {
        "force": max(load.force for load in model.loads),
        "torque": max(load.torque for load in model.loads),
        "rate": max(load.rate for load in model.loads) / viscosity,
    }


def _integrator_reason(model: Model) -> str:
    """Why the integrator is not the one that the scene asks for; empty if it is."""
    if model.features.integrator == model.scene.settings.integrator:
        return ""
    if model.features.walls:
        return "near hydrodynamic walls mobility and noise depend on place"
    if model.features.coupling:
        return "mobility and noise of coupled bodies depend on place"
    return "no force depends on place, so one stage is exact"


def describe(
    scene: Scene,
    *,
    worlds: int = 1,
    device: str | None = None,
    options: StepOptions | None = None,
    kernels: bool = False,
) -> dict[str, Any]:
    """Bodies, traps, time scales, step, terms in and out, and memory of a scene, ready for JSON.

    Arguments as for `Model.build`; a force that states no bounds is measured, and compiled for that. `kernels` compiles
    those of the step too, where they are not yet, and tells what a CUDA device keeps for them. Units are the internal
    ones (µm, s, pN, mW); None stands for infinite, absent, or not compiled yet.
    """
    model = Model.build(scene, worlds=worlds, device=device, options=options)
    groups = (State.start(model), Control.start(model), Readout.empty(model))
    scales = {k: _finite(v) if not isinstance(v, str | dict) else v for k, v in vars(model.scales).items()}
    steps = scene.settings.duration / model.time_step
    scales["errors"] = {name: _finite(error) for name, error in model.scales.errors.items()}
    return {
        "scene": str(scene.file or scene.root),
        "root": scene.root,
        "duration": scene.settings.duration,
        "frames_per_second": scene.settings.frames_per_second,
        "steps": round(steps) if math.isfinite(steps) else None,
        "worlds": worlds,
        "device": model.device.alias,
        "driver": model.features.driver,
        "precision": model.features.precision,
        "fast_math": model.features.fast_math,
        "noise": model.features.noise if model.features.brownian else "none",
        "bodies": _bodies(scene),
        "traps": _traps(model),
        "optics": _optics(model),
        "forces": _forces(model),
        "flow": _flow(scene),
        "obstacles": [
            {"name": o.prim, "shape": o.shape, "moves": o.position.animated or o.orientation.animated}
            for o in scene.obstacles
        ],
        "steady_loads": _loads(model),
        "time_scales": scales,
        "integrator_reason": _integrator_reason(model),
        "terms": [{"term": t, "compiled": on, "why": why} for t, on, why in terms(model.features)],
        "memory": device_bytes(model, *groups),
        "memory_per_world": _bytes_per_world(model, groups),
        "kernels": _kernels(model, compiled=kernels),
    }
