"""The workloads of `otwarp bench speed`: what is stepped, how it is counted, and how fast it should be.

Every workload is made by a function of a `Setting` and is then `Prepared`: something that takes steps. Those of a case
are measured in turns with the case's first one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial as p
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.rungs import TrappedBead, chosen_rungs
from otwarp.bench.scenes import HELD, PLACE, POWER, STIFFNESS, bead, robot, scene, spring
from otwarp.bench.speed.many_body import ManySpheres
from otwarp.bench.speed.peers import c_bead, numba_bead, numpy_bead
from otwarp.laws import TrapLaw
from otwarp.optics import Beam, Particle
from otwarp.scene import Scene, Track, Trap
from otwarp.shipped import shipped
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN

RELAXATION = 0.05
"""h = k·dt/γ of case a, as in the peers."""

PARTICLES, ROBOTS = {"cpu": 16384, "cuda": 1 << 20}, {"cpu": 4096, "cuda": 1 << 19}
SEED = 7

EULER, DEFAULT = "eulerMaruyama", "heun"


@dataclass(frozen=True, kw_only=True)
class PeerCode:
    """Another code for a workload.

    Attributes:
        label: For people, until its own name is known.
        code: A module as `otwarp.bench.speed.peers` describes it.
        kinds: For which it stands in the table: `cpu`, `cuda`.
        options: Further arguments of its `Peer`.
    """

    label: str
    code: Any
    kinds: tuple[str, ...] = ("cpu", "cuda")
    options: dict[str, Any] = field(default_factory=dict)

    def start(self, count: int, setting: Setting, **arguments: Any) -> Any:
        """The peer, ready to step.

        Raises:
            ImportError: Why it cannot run here.
        """
        reason = self.code.missing(setting.kind)
        if reason:
            raise ImportError(reason)
        return self.code.Peer(count, seed=SEED, kind=setting.kind, **arguments, **self.options)


BEAD_PEERS = tuple(
    PeerCode(label=label, code=code) for label, code in (("numpy", numpy_bead), ("c", c_bead), ("numba", numba_bead))
)
"""Peers of case a that come with otwarp; callers may have more of them, and of case b."""


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
        """Worlds of a workload that usually has `usual`: scaled by `scale`, at least 1."""
        return max(1, round(self.scale * usual))


@dataclass
class Prepared:
    """Something that takes steps.

    Attributes:
        step: Take so many steps, and return when they are done or on their way.
        worlds: Copies, or particles.
        per_step: Units of work in one step.
        check: Stationary variance over the exact one of the scheme, or None.
        name: What it is called, if that is known only here.
        sim: The simulation, if it is otwarp's.
    """

    step: Callable[[int], object]
    worlds: int
    per_step: float
    check: Callable[[], float] | None = None
    name: str = ""
    sim: Simulation | None = None


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
        wall: Whether it is timed by the wall on the CPU, too.
        least_steps: In one measured call, so that what is not done in every step has its share.
    """

    case: str
    label: str
    make: Callable[[Setting], Prepared]
    unit: str = "particle-steps/s"
    goals: dict[str, float] = field(default_factory=dict)
    peer: bool = False
    wall: bool = False
    least_steps: int = 1


def simulated(what: Scene, setting: Setting, usual: dict[str, int], **how: Any) -> Prepared:
    """Copies of a scene on one thread; a step of one is the unit. `how` are arguments of `Simulation`."""
    worlds = setting.count(usual[setting.kind])
    given = {"threads": 1, "allow_large_step": True, **how}
    sim = Simulation(what, worlds=worlds, seed=SEED, device=setting.device, **given)
    return Prepared(sim.step, worlds, worlds, sim=sim)


def case_a() -> tuple[Scene, float]:
    """A bead in a spring, and the time step that makes it relax by `RELAXATION`."""
    what = scene(bead(), traps=(spring(),))
    return what, RELAXATION * 6.0 * math.pi * what.medium.viscosity / STIFFNESS


def _bead(setting: Setting, *, integrator: str = EULER, fast_math: bool = False, noise: str = "gaussian") -> Prepared:
    """Case a, with the variance by which its physics is checked."""
    what, time_step = case_a()
    what = replace(what, settings=replace(what.settings, noise=noise))
    out = simulated(what, setting, PARTICLES, integrator=integrator, fast_math=fast_math, time_step=time_step)
    sim = out.sim
    assert sim is not None

    def check() -> float:
        x = sim.state.position.numpy()[:, 0].astype(float) - np.array(PLACE, dtype=np.float32).astype(float)
        exact = BOLTZMANN * what.medium.temperature / STIFFNESS * (1.0 + sim.model.scales.errors["variance"])
        return float(np.mean(x**2)) / exact

    return replace(out, check=check)


def _bead_peer(setting: Setting, *, peer: PeerCode) -> Prepared:
    """Case a in another code."""
    what, _ = case_a()
    variance = BOLTZMANN * what.medium.temperature / STIFFNESS
    beads, kick = setting.count(PARTICLES[setting.kind]), math.sqrt(2.0 * variance * RELAXATION)
    run = peer.start(beads, setting, relaxation=RELAXATION, kick=kick)
    return Prepared(run.step, beads, beads, lambda: run.variance() / variance * (1.0 - 0.5 * RELAXATION), run.name)


def _table(setting: Setting, *, rung: str, integrator: str = EULER, fast_math: bool = False) -> Prepared:
    """The bead of `otwarp bench forces` in a tabulated trap."""
    what = TrappedBead(Beam(numerical_aperture=1.2, power=POWER), Particle(radius=1.0, index=1.59))
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


def piecewise_robot() -> Scene:
    """The same robot in authored laws of the paper's kind, which end where the tables do."""
    what = robot()
    law = TrapLaw(stiffness=STIFFNESS, power=POWER, threshold=0.5, inverse_square=STIFFNESS * 0.5**3, cutoff=REACH)
    return replace(what, traps=tuple(replace(trap, model="piecewise", radial=law) for trap in what.traps))


def _robot(setting: Setting, *, make: Callable[[], Scene], **how: Any) -> Prepared:
    return simulated(make(), setting, ROBOTS, **how)


def _many_spheres(setting: Setting, *, count: int, fast_math: bool = False) -> Prepared:
    """Case b: soft Brownian spheres at volume fraction 0.15."""
    many = ManySpheres(setting.count(count), setting.device, fast_math=fast_math)
    # lists and clocks, not equilibrium
    many.step(LISTED)
    return Prepared(many.step, many.count, many.count)


def _crowd_peer(setting: Setting, *, count: int, peer: PeerCode) -> Prepared:
    """The same spheres in another code."""
    spheres = setting.count(count)
    run = peer.start(spheres, setting)
    run.step(LISTED)
    return Prepared(run.step, spheres, spheres, name=f"{run.name}, {spheres:.0e} spheres")


def _many(setting: Setting, *, worlds: int) -> Prepared:
    """Case a in so many worlds, whatever the scale."""
    what, time_step = case_a()
    return simulated(what, replace(setting, scale=1.0), {setting.kind: worlds}, time_step=time_step, integrator=EULER)


def _threads(setting: Setting, *, threads: int, model: str) -> Prepared:
    if model == "robot":
        return _robot(setting, make=table_robot, integrator=EULER, threads=threads)
    what, time_step = case_a()
    return simulated(what, setting, PARTICLES, time_step=time_step, integrator=EULER, threads=threads)


def _delivery(setting: Setting, *, worlds: int) -> Prepared:
    """The shipped cell delivery with contact, from its start; a simulated second of one world is the unit.

    Once the cell is delivered it starts anew, because at rest there is less to do.
    """
    what = Scene.load(shipped("scenes", "cell_delivery"))
    out = simulated(what, setting, {setting.kind: worlds})
    sim = out.sim
    assert sim is not None
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

    return replace(out, step=step, per_step=out.worlds * sim.time_step)


def _robots(math_kinds: tuple[bool, ...]) -> Iterator[Workload]:
    """The robot in tables that act on all of its spheres, in tables that end, and in authored laws that end."""
    end = f"that end at {REACH:g} µm"
    robots: dict[str, Callable[[], Scene]] = {
        "three bilinear tables": table_robot,
        f"three bilinear tables {end}": p(table_robot, REACH),
        f"three piecewise laws {end}": piecewise_robot,
    }
    best = {EULER: {"cpu": 1e7, "cuda": 2.5e10}, DEFAULT: {"cuda": 1.2e10}}
    for traps, make in robots.items():
        for fast in math_kinds:
            for integrator in (EULER, DEFAULT):
                math_kind = ", fast math" if fast else ""
                goals = best[integrator] if traps.endswith(end) and fast == math_kinds[-1] else {}
                label = f"five-element robot, {traps}, {integrator}{math_kind}"
                how = p(_robot, make=make, integrator=integrator, fast_math=fast)
                yield Workload(case="robot", label=label, make=how, unit="robot-steps/s", goals=goals)


def _beads(kind: str, math_kinds: tuple[bool, ...], peers: Sequence[PeerCode]) -> Iterator[Workload]:
    """Case a, ours and others'."""
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
    for peer in peers:
        if kind in peer.kinds:
            yield Workload(case="bead", label=peer.label, make=p(_bead_peer, peer=peer), peer=True)


def _tables(math_kinds: tuple[bool, ...]) -> Iterator[Workload]:
    """The bead in tabulated traps."""
    for rung, wanted in (("bilinear-1e-3", {"cpu": 6e7, "cuda": 1.3e11}), ("bicubic-1e-3", {"cuda": 6e10})):
        for fast in math_kinds:
            for integrator in (EULER, DEFAULT):
                label = f"bead in a {rung.replace('-', ' table ', 1)}, {integrator}{', fast math' if fast else ''}"
                make = p(_table, rung=rung, integrator=integrator, fast_math=fast)
                best = wanted if integrator == EULER and fast == math_kinds[-1] else {}
                yield Workload(case="table", label=label, make=make, goals=best)


def _many_bodies(kind: str, math_kinds: tuple[bool, ...], peers: Sequence[PeerCode]) -> Iterator[Workload]:
    """Case b at several sizes, each a case of its own, ours and others'."""
    for count in (10_000, 100_000, 1_000_000) if kind == "cpu" else (10_000, 100_000, 1_000_000, 10_000_000):
        case = f"crowd {count:.0e}"
        wanted = {"cuda": 4.7e9} if count == 1_000_000 else {}
        for fast in math_kinds:
            label = f"case b, {count:.0e} spheres{', fast math' if fast else ''}"
            make, best = p(_many_spheres, count=count, fast_math=fast), wanted if fast == math_kinds[-1] else {}
            yield Workload(case=case, label=label, make=make, goals=best, least_steps=LISTED)
        for peer in peers:
            if kind in peer.kinds:
                label, make = f"{peer.label}, {count:.0e} spheres", p(_crowd_peer, count=count, peer=peer)
                yield Workload(case=case, label=label, make=make, peer=True, least_steps=LISTED)


def workloads(
    kind: str, bead_peers: Sequence[PeerCode] = BEAD_PEERS, many_body_peers: Sequence[PeerCode] = ()
) -> Iterator[Workload]:
    """All rows for a kind of device, case by case; peers of case a and of case b."""
    math_kinds = (False,) if kind == "cpu" else (False, True)
    yield from _beads(kind, math_kinds, bead_peers)
    yield from _tables(math_kinds)
    yield from _robots(math_kinds)
    for worlds in (1, 64) if kind == "cpu" else (1, 4096, 65536):
        label = f"cell delivery, {worlds} world{'s' if worlds > 1 else ''}, default integrator"
        wanted = {"cpu": 30.0} if worlds == 1 else {}
        make = p(_delivery, worlds=worlds)
        yield Workload(case="delivery", label=label, make=make, unit="worlds × real time", goals=wanted)
    yield from _many_bodies(kind, math_kinds, many_body_peers)
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
