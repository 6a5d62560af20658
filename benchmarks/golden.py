"""Golden digests: SHA-256 of what the simulation computes, to prove that a change of code changes no number.

    python -m benchmarks.golden record golden.json
    python -m benchmarks.golden compare golden.json [--scenes DIR] [--only PART]... [--recorded-step]

`record` steps every case of `CASES` on the CPU and writes the digests of positions, orientations, foci and every array
of the readout, beside the time step; `compare` does so again and lists what differs; arrays that the record does not
know are new, and pass. Where another time step is chosen now, all else differs, too: `--recorded-step` takes that of
the record instead, and shows what differs besides. A case is a shipped scene, or one with a few attributes edited so
that together they reach every driver and term. Digests depend on the processor, and so on machine and compiler: they
compare two states of the code on one machine. `--recording FILE.mcap` also replays haptic recordings, whose forces must
be equal bit for bit.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

import otwarp as ot
from benchmarks.report import check_places, run

SCENES = Path(__file__).parents[1] / "scenes"
INTEGRATORS = ("eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential")
PRECISIONS = ("float32", "float64")
HEUN = ("heun",)
SINGLE = ("float32",)

Edit = Callable[[Usd.Stage], None]


def values(pattern: str, **attributes: object) -> Edit:
    """Set attributes, named with `_` for `:`, of the prims that have them and whose path contains `pattern`."""

    def edit(stage: Usd.Stage) -> None:
        found = 0
        for prim, (name, value) in itertools.product(list(stage.Traverse()), attributes.items()):
            attribute = prim.GetAttribute(name.replace("_", ":"))
            if pattern in str(prim.GetPath()) and attribute:
                attribute.Set(value)
                found += 1
        assert found, f"no prim with {pattern} in its path has {', '.join(attributes)}"

    return edit


def applied(path: str, schema: str, **attributes: object) -> Edit:
    """Apply an API schema to a prim, made as an Xform if there is none."""
    types = {str: Sdf.ValueTypeNames.Token, float: Sdf.ValueTypeNames.Double, bool: Sdf.ValueTypeNames.Bool}

    def edit(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(path) or UsdGeom.Xform.Define(stage, path).GetPrim()
        prim.AddAppliedSchema(schema)
        for name, value in attributes.items():
            prim.CreateAttribute(name.replace("_", ":"), types[type(value)]).Set(value)

    return edit


def obstacle(kind: str, place: tuple[float, float, float], **sizes: object) -> Edit:
    """Add an obstacle of a USD shape at a place [µm]."""

    def edit(stage: Usd.Stage) -> None:
        prim = getattr(UsdGeom, kind).Define(stage, f"/World/extra_{kind}").GetPrim()
        UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(*place))
        UsdPhysics.CollisionAPI.Apply(prim)
        for name, value in sizes.items():
            prim.GetAttribute(name).Set(value)

    return edit


def one_curve(stage: Usd.Stage) -> None:
    """Let the radial force curve of the bead's trap serve for all directions."""
    prim = stage.GetPrimAtPath("/World/Traps/trap")
    for schema in ("axial", "radial"):
        prim.RemoveAppliedSchema(f"OtTrapLawAPI:{schema}")
    prim.AddAppliedSchema("OtTrapLawAPI:isotropic")
    for name in [n for n in prim.GetPropertyNames() if n.startswith("ot:trapLaw:")]:
        law, curve = prim.GetAttribute(name), name.replace(":radial:", ":isotropic:")
        if curve != name:
            prim.CreateAttribute(curve, law.GetTypeName()).Set(law.Get())
        prim.RemoveProperty(name)


def plate(distance: float) -> Edit:
    """A hydrodynamic plane below bodies at a height of 10 µm."""
    wall = applied("/World/extra_Plane", "OtObstacleAPI", ot_obstacle_hydrodynamic=True)

    def edit(stage: Usd.Stage) -> None:
        obstacle("Plane", (0.0, 0.0, 10.0 - distance), axis="Z")(stage)
        wall(stage)

    return edit


def flow(kind: str) -> Edit:
    """A background flow of some µm/s."""
    about = {"ot_flow_speed": 4e-6, "ot_flow_shearRate": 0.5, "ot_flow_halfHeight": 1e-4}
    return applied("/World/extra_flow", "OtFlowAPI", ot_flow_kind=kind, **about)


TETRAHEDRON = {
    "points": [(-4.0, -4.0, 0.0), (4.0, -4.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, -4.0)],
    "faceVertexCounts": [3, 3, 3, 3],
    "faceVertexIndices": [0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0],
}
BUSY = (values("World", ot_scene_gravity=True), flow("poiseuille"))
LIMITED = values("Traps", ot_trap_speedLimit=2e-5)
COUPLED = values("World", ot_scene_hydrodynamicCoupling=True)
RODS = tuple(applied(f"/World/dimer/{name}", "OtRodAPI", ot_rod_collides=True, ot_rod_drag=True) for name in ("rod",))
LOOSE = values("bead", ot_sphere_collides=False)
SOFT = values("Cells", ot_cell_youngsModulus=2.0)
STIFF = values("cell", ot_cell_youngsModulus=1e6)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A shipped scene, edited, and how it is stepped.

    Attributes:
        scene: Name of the file without its ending.
        edits: What differs from it.
        steps: Twice that many steps are taken, the second half with weaker traps that stand still.
    """

    scene: str
    edits: tuple[Edit, ...] = ()
    integrators: tuple[str, ...] = INTEGRATORS
    precisions: tuple[str, ...] = PRECISIONS
    noise: str | None = None
    worlds: int = 3
    steps: int = 100
    fast_math: bool = False
    swept: tuple[str, ...] = ("medium_viscosity",)


CASES: dict[str, Case] = {
    "single_bead": Case(scene="single_bead", steps=200),
    "two_trap_dimer": Case(scene="two_trap_dimer", steps=200),
    "strategy_a": Case(scene="strategy_a", steps=200),
    "strategy_b": Case(scene="strategy_b", steps=200),
    "force_models": Case(scene="force_models", steps=50),
    "cell_delivery": Case(scene="cell_delivery"),
    "teleop_small": Case(scene="teleop_small"),
    "microfluidic_channel": Case(scene="microfluidic_channel", precisions=SINGLE, worlds=2, steps=20),
    "ten_thousand_cells": Case(
        scene="ten_thousand_cells", integrators=HEUN, precisions=SINGLE, worlds=2, steps=5, swept=()
    ),
    # noise and scheme
    "bead, uniform": Case(scene="single_bead", noise="uniform", integrators=HEUN),
    "bead, three-point": Case(scene="single_bead", noise="threePoint", integrators=HEUN),
    "bead, fast": Case(scene="single_bead", fast_math=True, integrators=HEUN, precisions=SINGLE),
    "bead, quiet": Case(scene="single_bead", edits=(values("World", ot_scene_brownian=False),), integrators=HEUN),
    "bead, swept": Case(
        scene="single_bead",
        integrators=HEUN,
        precisions=SINGLE,
        swept=("medium_viscosity", "medium_temperature", "trap_power", "trap_stiffness", "trap_axial_stiffness"),
    ),
    # gravity and flow, alone and in rigid bodies
    "bead, uniform flow": Case(scene="single_bead", edits=(flow("uniform"),), integrators=HEUN),
    "bead, shear flow": Case(scene="single_bead", edits=(flow("shear"),), integrators=HEUN, precisions=SINGLE),
    "bead, busy": Case(scene="single_bead", edits=BUSY, integrators=("heun", "exponential")),
    "dimer, busy": Case(scene="two_trap_dimer", edits=BUSY, integrators=("heun", "leimkuhlerMatthews")),
    # optical models in the solo driver, one curve for all directions, bicubic tables
    "models, solo": Case(scene="force_models", edits=(LOOSE,), integrators=HEUN, steps=50),
    "models, bicubic": Case(
        scene="force_models",
        edits=(LOOSE, values("Traps", ot_trap_interpolation="bicubic", ot_trap_polarization="x")),
        integrators=HEUN,
        precisions=SINGLE,
        steps=20,
    ),
    "bead, one curve": Case(scene="single_bead", edits=(one_curve,), integrators=HEUN),
    # speed limits, with and without contact; gravity in contact
    "bead, limited": Case(scene="single_bead", edits=(LIMITED,)),
    "teleop, busy": Case(scene="teleop_small", edits=BUSY, integrators=HEUN),
    "delivery, limited": Case(scene="cell_delivery", edits=(LIMITED,), integrators=HEUN, precisions=SINGLE),
    # obstacle shapes
    "bead, sphere": Case(
        scene="single_bead", edits=(obstacle("Sphere", (0.3, 0.2, 6.0), radius=3.05),), integrators=HEUN
    ),
    "bead, capsule": Case(
        scene="single_bead",
        edits=(obstacle("Capsule", (0.3, 0.2, 6.9), radius=2.1, height=4.0, axis="X"),),
        integrators=HEUN,
    ),
    "bead, mesh": Case(
        scene="single_bead",
        edits=(obstacle("Mesh", (0.3, 0.2, 8.95), **TETRAHEDRON),),
        integrators=HEUN,
        precisions=SINGLE,
    ),
    "dimer, rod": Case(
        scene="two_trap_dimer", edits=(*RODS, obstacle("Sphere", (0.1, 0.3, 7.92), radius=1.5)), integrators=HEUN
    ),
    # contacts as stiff as polymer, which are solved for their forces
    "delivery, stiff": Case(scene="cell_delivery", edits=(STIFF,), integrators=("heun", "eulerMaruyama")),
    "teleop, stiff": Case(
        scene="teleop_small",
        edits=(STIFF, obstacle("Sphere", (-14.0, -12.0, 1.0), radius=4.05)),
        integrators=("heun", "exponential"),
    ),
    # hydrodynamic walls and coupling
    "bead, wall": Case(scene="single_bead", edits=(LOOSE, plate(1.5)), integrators=("heun", "eulerMaruyama")),
    "bead, wall in contact": Case(scene="single_bead", edits=(plate(1.1),), integrators=HEUN),
    "dimer, wall": Case(scene="two_trap_dimer", edits=(plate(2.0),), integrators=("heun", "eulerMaruyama")),
    "models, coupled": Case(scene="force_models", edits=(COUPLED,), integrators=("heun", "eulerMaruyama"), steps=50),
    "teleop, coupled": Case(scene="teleop_small", edits=(COUPLED,), integrators=HEUN),
    # many bodies
    "channel, limited": Case(
        scene="microfluidic_channel", edits=(LIMITED,), integrators=HEUN, precisions=SINGLE, worlds=1, steps=20
    ),
    "cells, soft": Case(
        scene="ten_thousand_cells", edits=(SOFT,), integrators=HEUN, precisions=SINGLE, worlds=1, steps=3, swept=()
    ),
}
"""Cases by name; each runs with every one of its integrators and precisions."""


def load(case: Case, folder: Path, work: Path) -> ot.Scene:
    """The scene of a case; edits are made on a copy below `work`."""
    file = folder / f"{case.scene}.usda"
    if not case.edits:
        return ot.Scene.load(file)
    stage = Usd.Stage.Open(str(file))
    for edit in case.edits:
        edit(stage)
    copy = work / f"{case.scene}.usda"
    stage.Export(str(copy))
    return ot.Scene.load(copy)


def sweep(scene: ot.Scene, names: tuple[str, ...], worlds: int) -> dict[str, np.ndarray]:
    """Parameters that differ between worlds."""
    factors = 1.0 + 0.03 * np.arange(worlds)
    given = {
        "medium_viscosity": scene.medium.viscosity * factors,
        "medium_temperature": scene.medium.temperature / factors,
        "trap_power": factors[:, None],
        "trap_stiffness": factors[:, None],
        "trap_axial_stiffness": 0.5 * factors[:, None],
    }
    return {name: given[name] for name in names}


def digest(array: np.ndarray) -> str:
    """SHA-256 of type, shape and numbers."""
    head = f"{array.dtype.str} {array.shape} ".encode()
    return hashlib.sha256(head + np.ascontiguousarray(array).tobytes()).hexdigest()


def stepped(
    scene: ot.Scene, case: Case, integrator: str, precision: str, time_step: float | None = None
) -> dict[str, str]:
    """Digests of state and readout halfway and at the end of one run, or what was refused."""
    try:
        sim = ot.Simulation(
            scene,
            worlds=case.worlds,
            seed=7,
            device="cpu",
            parameters=sweep(scene, case.swept, case.worlds),
            integrator=integrator,
            time_step=time_step,
            noise=case.noise,
            precision=precision,
            fast_math=case.fast_math,
        )
        found = {"time_step": float(sim.time_step).hex()}
        for half in ("half", "end"):
            sim.step(case.steps)
            for part in (sim.state, sim.readout):
                for name, array in sorted(vars(part).items()):
                    if hasattr(array, "numpy"):
                        found[f"{half} {name}"] = digest(array.numpy())
            if sim.control.trap_power.shape[-1]:
                sim.control.set(trap_power=0.9 * sim.readout.trap_power.numpy(), follow=False)
    except (ot.InputError, ot.SimulationError) as error:
        return {"refused": type(error).__name__}
    return found


def runs(only: list[str]) -> Iterator[tuple[str, Case, str, str]]:
    """(name, case, integrator, precision) of every run whose name contains one of `only`; of all for none."""
    for label, case in CASES.items():
        for integrator, precision in itertools.product(case.integrators, case.precisions):
            name = f"{label} · {integrator} · {precision}"
            if not only or any(part in name for part in only):
                yield name, case, integrator, precision


def measure(folder: Path, only: list[str], steps: Mapping[str, str] = {}) -> Iterator[tuple[str, dict[str, str]]]:
    """Name and digests of run after run; `steps` holds the time steps of those that do not choose their own [s]."""
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as work:
        loaded: tuple[Case, ot.Scene] | None = None
        for name, case, integrator, precision in runs(only):
            if loaded is None or loaded[0] is not case:
                loaded = case, load(case, folder, Path(work))
            begun = time.perf_counter()
            given = float.fromhex(steps[name]) if name in steps else None
            found = stepped(loaded[1], case, integrator, precision, given)
            print(f"{time.perf_counter() - begun:6.1f} s  {name}{'  refused' * ('refused' in found)}", flush=True)
            yield name, found


def replay(file: Path) -> list[str]:
    """What a replayed haptic recording does otherwise."""
    command = Path(sys.executable).with_name("otwarp")
    done = subprocess.run([command, "haptics", "replay", file], capture_output=True, text=True)
    return [] if done.returncode == 0 else [f"{file.name}: {(done.stdout + done.stderr).strip()}"]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path, help="where the digests are")
    parser.add_argument("--scenes", type=Path, default=SCENES, help="folder of the scenes; default: the shipped ones")
    parser.add_argument("--only", action="append", default=[], metavar="PART", help="runs whose name contains PART")
    parser.add_argument("--recorded-step", action="store_true", help="compare: take the time steps of the record")
    parser.add_argument("--recording", action="append", default=[], type=Path, help="haptic recording to replay")
    asked = parser.parse_args()
    if asked.what == "record":
        check_places(asked.file)
        known = json.loads(asked.file.read_text()) if asked.only and asked.file.exists() else {}
        for name, found in measure(asked.scenes, asked.only):
            known[name] = found
            asked.file.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n")
        return
    known, bad = json.loads(asked.file.read_text()), []
    steps = {name: kept["time_step"] for name, kept in known.items() if asked.recorded_step and "time_step" in kept}
    for name, found in measure(asked.scenes, asked.only, steps):
        kept = known.get(name, {})
        bad += [f"{name}: {key}" for key in sorted(kept) if kept.get(key) != found.get(key)]
    for file in asked.recording:
        bad += replay(file)
    print("\n".join(["differs:", *bad]) if bad else "all equal")
    sys.exit(bool(bad))


if __name__ == "__main__":
    run(main)
