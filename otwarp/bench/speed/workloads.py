"""The workloads of `otwarp bench speed`: what is stepped, how it is counted, and how fast it should be.

Every workload is made by a function of a `Setting` and is a `Runner`: something that takes steps. Those of a case are
measured in turns with the case's first one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial as p
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.beside import beside
from otwarp.bench.rungs import TrappedBead, chosen_rungs
from otwarp.bench.scenes import HELD, PLACE, POWER, STIFFNESS, bead, robot, scene, spring
from otwarp.optics import Beam, Sphere
from otwarp.scene import Scene, Track, Trap
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN

RELAXATION = 0.05
"""h = k·dt/γ of case a, as in the peers."""

PARTICLES, ROBOTS = {"cpu": 16384, "cuda": 1 << 20}, {"cpu": 4096, "cuda": 1 << 19}
SEED = 7

EULER, DEFAULT = "eulerMaruyama", "heun"

BEAD_PEERS = (
    "numpy_bead", "c_bead", "numba_bead", "torch_bead", "jax_bead", "cupy_bead", "lammps_bead", "openmm_bead",
)  # fmt: skip
CROWD_PEERS = ("c_crowd", "numba_crowd", "lammps_crowd", "openmm_crowd")
"""Modules of `benchmarks.peers`."""


@dataclass(frozen=True)
class Setting:
    """Where and how large.

    Attributes:
        device: Where otwarp runs.
        scale: Part of the usual number of worlds.
    """

    device: wp.Device
    scale: float = 1.0

    @property
    def kind(self) -> str:
        """`cpu` or `cuda`."""
        return "cpu" if self.device.is_cpu else "cuda"

    def count(self, usual: int) -> int:
        """Worlds of a workload."""
        return max(1, round(self.scale * usual))


@dataclass
class Runner:
    """Something that takes steps.

    Attributes:
        step: Take so many steps, and return when they are done or on their way.
        worlds: Copies, or particles.
        per_step: Units of work in one step.
        check: Stationary variance over the exact one of the scheme, or None.
        name: What it is called, if that is known only here.
    """

    step: Callable[[int], object]
    worlds: int
    per_step: float
    check: Callable[[], float] | None = None
    name: str = ""


@dataclass(frozen=True, kw_only=True)
class Workload:
    """One row.

    Attributes:
        case: Name of its case.
        label: For people.
        make: Prepare it.
        unit: What is counted.
        goals: Rate wanted by kind of device.
        peer: Whether it is not otwarp's.
        kinds: Where it runs.
        wall: Whether it is timed by the wall on the CPU, too.
        least_steps: In one measured call, so that what is not done in every step has its share.
    """

    case: str
    label: str
    make: Callable[[Setting], Runner]
    unit: str = "particle-steps/s"
    goals: dict[str, float] = field(default_factory=dict)
    peer: bool = False
    kinds: tuple[str, ...] = ("cpu", "cuda")
    wall: bool = False
    least_steps: int = 1


def simulated(
    what: Scene, setting: Setting, usual: dict[str, int], *, time_step: float | None = None, **how: Any
) -> Runner:
    """Copies of a scene on one thread; a step of one is the unit."""
    worlds = setting.count(usual[setting.kind])
    how = {"threads": 1, **how}
    sim = Simulation(what, worlds=worlds, seed=SEED, device=setting.device, time_step=time_step, **how)
    return Runner(sim.step, worlds, worlds)


def case_a() -> tuple[Scene, float]:
    """A bead in a spring, and the time step that makes it relax by `RELAXATION`."""
    what = scene(bead(), traps=(spring(),))
    return what, RELAXATION * 6.0 * math.pi * what.medium.viscosity / STIFFNESS


def _bead(setting: Setting, *, integrator: str = EULER, fast_math: bool = False, noise: str = "gaussian") -> Runner:
    """Case a, with the variance by which its physics is checked."""
    what, time_step = case_a()
    what = replace(what, settings=replace(what.settings, noise=noise))
    worlds = setting.count(PARTICLES[setting.kind])
    how: dict[str, Any] = {"integrator": integrator, "fast_math": fast_math, "threads": 1, "time_step": time_step}
    sim = Simulation(what, worlds=worlds, seed=SEED, device=setting.device, **how)

    def check() -> float:
        x = sim.state.position.numpy()[:, 0].astype(float) - np.array(PLACE, dtype=np.float32).astype(float)
        exact = BOLTZMANN * what.medium.temperature / STIFFNESS * (1.0 + sim.model.scales.variance_error)
        return float(np.mean(x**2)) / exact

    return Runner(sim.step, worlds, worlds, check)


def _peer(module: str, **how: Any) -> Callable[[Setting], Runner]:
    """A peer of case a."""

    def make(setting: Setting) -> Runner:
        """The peer, or the reason why it is not here."""
        code = beside(f"peers.{module}")
        reason = code.missing(setting.kind)
        if reason:
            raise ImportError(reason)
        beads = setting.count(PARTICLES[setting.kind])
        what, _ = case_a()
        variance = BOLTZMANN * what.medium.temperature / STIFFNESS
        kick = math.sqrt(2.0 * variance * RELAXATION)
        peer = code.Peer(beads, relaxation=RELAXATION, kick=kick, seed=SEED, kind=setting.kind, **how)
        return Runner(peer.step, beads, beads, lambda: peer.variance() / variance * (1.0 - 0.5 * RELAXATION), peer.name)

    return make


def _table(setting: Setting, *, rung: str, integrator: str = EULER, fast_math: bool = False) -> Runner:
    """The bead of `otwarp bench forces` in a tabulated trap."""
    what = TrappedBead(Beam(numerical_aperture=1.2, power=POWER), Sphere(radius=1.0, index=1.59))
    found = next(r for r in chosen_rungs((rung,)) if r.name == rung)
    how: dict[str, Any] = {"integrator": integrator, "fast_math": fast_math}
    return simulated(what.scene(found), setting, PARTICLES, time_step=what.time_step, **how)


LISTED = 20
"""Steps of case b in one measured call, at least: about two neighbour lists."""

REACH = 1.0
"""Where the traps of `table_robot` end when they are cut off: within it a trap acts on its own sphere alone [µm]."""


def table_robot(reach: float = math.inf) -> Scene:
    """Five spheres in a shallow U, tabulated traps on both ends and the middle, felt up to `reach` [µm]."""
    what = robot()
    traps = tuple(
        Trap(
            prim=trap.prim,
            position=trap.position,
            power=Track.constant(POWER),
            model="table",
            numerical_aperture=1.2,
            holds=f"/World/robot/sphere{i}",
            reach=reach,
        )
        for trap, i in zip(what.traps, HELD, strict=True)
    )
    return replace(what, traps=traps)


def _robot(setting: Setting, *, reach: float = math.inf, **how: Any) -> Runner:
    return simulated(table_robot(reach), setting, ROBOTS, **how)


def _crowd(setting: Setting, *, count: int, fast_math: bool = False) -> Runner:
    """Case b: soft Brownian spheres at volume fraction 0.15."""
    crowd = beside("crowd").Crowd(setting.count(count), setting.device, fast_math=fast_math)
    # lists and clocks, not equilibrium
    crowd.step(20)
    return Runner(crowd.step, crowd.count, crowd.count)


def _crowd_peer(setting: Setting, *, count: int, module: str) -> Runner:
    """The same spheres in another code."""
    code = beside(f"peers.{module}")
    reason = code.missing(setting.kind)
    if reason:
        raise ImportError(reason)
    spheres = setting.count(count)
    peer = code.Peer(spheres, seed=SEED, kind=setting.kind)
    peer.step(20)
    return Runner(peer.step, spheres, spheres, name=f"{peer.name}, {spheres:.0e} spheres")


def _many(setting: Setting, *, worlds: int) -> Runner:
    """Case a in so many worlds, whatever the scale."""
    what, time_step = case_a()
    return simulated(what, replace(setting, scale=1.0), {setting.kind: worlds}, time_step=time_step, integrator=EULER)


def _threads(setting: Setting, *, threads: int, model: str) -> Runner:
    if model == "robot":
        return _robot(setting, integrator=EULER, threads=threads)
    what, time_step = case_a()
    return simulated(what, setting, PARTICLES, time_step=time_step, integrator=EULER, threads=threads)


def _delivery(setting: Setting, *, worlds: int) -> Runner:
    """The shipped cell delivery with contact, from its start; a simulated second of one world is the unit.

    Once the cell is delivered it starts anew, because at rest there is less to do.
    """
    scenes = beside("startup").ROOT / "scenes"
    what = Scene.load(scenes / "cell_delivery.usda")
    count = setting.count(worlds)
    sim = Simulation(what, worlds=count, seed=SEED, device=setting.device, threads=1)
    moving = (sim.state.position, sim.state.orientation, sim.state.trap_position)
    start = [wp.clone(array) for array in moving]
    whole = round(what.settings.duration / sim.time_step)

    def step(steps: int) -> None:
        """Start again whenever the scene is over."""
        while steps > 0:
            count = min(steps, whole - sim.state.step)
            sim.step(count)
            steps -= count
            if sim.state.step == whole:
                sim.state.step, sim.state.time = 0, 0.0
                for array, first in zip(moving, start, strict=True):
                    wp.copy(array, first)

    return Runner(step, count, count * sim.time_step)


def _robots(math_kinds: tuple[bool, ...]) -> Iterator[Workload]:
    """The robot in tables that act on all of its spheres, and in tables that end."""
    for reach, ending in ((math.inf, ""), (REACH, f" that end at {REACH:g} µm")):
        for fast in math_kinds:
            for integrator in (EULER, DEFAULT):
                math_kind = ", fast math" if fast else ""
                label = f"five-element robot, three bilinear tables{ending}, {integrator}{math_kind}"
                best = {"cpu": 1e7, "cuda": 2.5e10} if ending and integrator == EULER and fast == math_kinds[-1] else {}
                make = p(_robot, reach=reach, integrator=integrator, fast_math=fast)
                yield Workload(case="robot", label=label, make=make, unit="robot-steps/s", goals=best)


def workloads(kind: str) -> Iterator[Workload]:
    """All rows for a kind of device, case by case."""
    math_kinds = (False,) if kind == "cpu" else (False, True)
    goals = {False: {"cpu": 1.2e8, "cuda": 1.3e11}, True: {"cuda": 2.3e11}}
    for fast in math_kinds:
        word = ", fast math" if fast else ""
        for integrator in (EULER, DEFAULT):
            make = p(_bead, integrator=integrator, fast_math=fast)
            wanted = goals[fast] if integrator == EULER else {}
            yield Workload(case="bead", label=f"bead in a spring, {integrator}{word}", make=make, goals=wanted)
        make = p(_bead, fast_math=fast, noise="threePoint")
        wanted = {"cuda": 2.9e11} if fast else {}
        label = f"bead in a spring, {EULER}, three-point noise{word}"
        yield Workload(case="bead", label=label, make=make, goals=wanted)
    for module in BEAD_PEERS:
        yield Workload(case="bead", label=module.removesuffix("_bead"), make=_peer(module), peer=True)
    if kind == "cuda":
        yield Workload(case="bead", label="cupy, fast intrinsics", make=_peer("cupy_bead", fast=True), peer=True)
    for rung, wanted in (
        ("bilinear-1e-3", {"cpu": 6e7, "cuda": 1.3e11}),
        ("bicubic-1e-3", {"cuda": 6e10}),
    ):
        for fast in math_kinds:
            for integrator in (EULER, DEFAULT):
                label = f"bead in a {rung.replace('-', ' table ', 1)}, {integrator}{', fast math' if fast else ''}"
                make = p(_table, rung=rung, integrator=integrator, fast_math=fast)
                best = wanted if integrator == EULER and fast == math_kinds[-1] else {}
                yield Workload(case="table", label=label, make=make, goals=best)
    yield from _robots(math_kinds)
    for worlds in (1, 64) if kind == "cpu" else (1, 4096, 65536):
        label = f"cell delivery, {worlds} world{'s' if worlds > 1 else ''}, default integrator"
        wanted = {"cpu": 30.0} if worlds == 1 else {}
        make = p(_delivery, worlds=worlds)
        yield Workload(case="delivery", label=label, make=make, unit="worlds × real time", goals=wanted)
    for count in (10_000, 100_000, 1_000_000) if kind == "cpu" else (10_000, 100_000, 1_000_000, 10_000_000):
        wanted = {"cuda": 4.7e9} if count == 1_000_000 else {}
        for fast in math_kinds:
            label = f"case b, {count:.0e} spheres{', fast math' if fast else ''}"
            make, best = p(_crowd, count=count, fast_math=fast), wanted if fast == math_kinds[-1] else {}
            case = f"crowd {count:.0e}"
            yield Workload(case=case, label=label, make=make, goals=best, least_steps=LISTED)
        for module in CROWD_PEERS:
            label = f"{module.removesuffix('_crowd')}, {count:.0e} spheres"
            make = p(_crowd_peer, count=count, module=module)
            yield Workload(case=f"crowd {count:.0e}", label=label, make=make, peer=True, least_steps=LISTED)
    for worlds in (1_000, 10_000, 100_000) if kind == "cpu" else (1_000, 10_000, 100_000, 1_000_000):
        yield Workload(case="scaling", label=f"bead in a spring, {worlds:.0e} worlds", make=p(_many, worlds=worlds))
    if kind == "cpu":
        for model, unit in (("bead in a spring", "particle-steps/s"), ("robot", "robot-steps/s")):
            for threads in (1, 2):
                label = f"{model}, {threads} thread{'s' if threads > 1 else ''}, wall time"
                make = p(_threads, threads=threads, model="robot" if model == "robot" else "bead")
                yield Workload(case=f"threads {model}", label=label, make=make, unit=unit, wall=True)


CASES = ("bead", "table", "robot", "delivery", "crowd", "scaling", "threads")
"""Names for `--case`."""
