"""Contacts: what a step costs of bodies that touch; each solver, with what it leaves; a channel that jams.

`python -m benchmarks.contact --device cuda:0`
"""

from __future__ import annotations

import contextlib
import dataclasses
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.kernels.contact.body_solve import MAX_POINTS
from otwarp.kernels.core.precision import PRECISIONS, kernel_module
from otwarp.scene import Scene
from otwarp.simulation import model
from otwarp.simulation.drivers.compilation import kernel_memory
from otwarp.simulation.drivers.stepping import PhasedStepper
from otwarp.simulation.simulation import Simulation

SCENES = Path(__file__).resolve().parent.parent / "scenes"
TOUCHING, APART = "cell_delivery", "teleop_small"
"""Two robots that squeeze a cell, and the same bodies apart."""
CHANNEL = "microfluidic_channel"
"""Cells that a flow carries round a periodic channel; they begin apart, and meet."""
WORLDS = {"cpu": (1,), "cuda": (1, 1_024, 16_384, 131_072)}
"""Worlds of which a step is timed."""
CHANNELS = {"cpu": 1, "cuda": 1_024}
"""Worlds of the channel."""
STEPS = {"cpu": 2_000, "cuda": 100}
"""Steps of one measurement."""
COMPARED = 64
"""Worlds whose steps are compared in both precisions."""
MET = 150
"""Steps after which robots and cell touch."""
ROUNDS_OF_CHANNEL = 2.0
"""Times that the fastest cell goes round the channel."""
PARTS = 8
"""Parts of that way, each timed as a whole."""

MODULI = {"as authored: cell 1 kPa, robots 1 MPa": None, "all 1 kPa": 1e3, "all 1 MPa": 1e6}
"""Young's moduli of the bodies [Pa]."""

SOLVERS = {
    "pair space: three unknowns a body": (True, MAX_POINTS),
    "body space: six unknowns a rigid body": (True, 0),
    "contact space: one unknown a contact": (False, MAX_POINTS),
}
"""Whether contacts are solved for what they move, and up to how many bodies for what they move one point of each."""
EXACT = "body space: six unknowns a rigid body"
"""The solver that, in float64, the others are compared with: what is out of balance then moves no body by 10⁻¹⁰ µm."""


def load(name: str, modulus: float | None = None) -> Scene:
    """A shipped scene, its bodies of another modulus [Pa] if one is given."""
    scene = Scene.load(SCENES / f"{name}.usda")
    if modulus is None:
        return scene
    made = partial(dataclasses.replace, youngs_modulus=modulus)
    return dataclasses.replace(
        scene, bodies=tuple(dataclasses.replace(b, material=made(b.material)) for b in scene.bodies)
    )


def step_time(name: str, worlds: int, device: wp.Device, steps: int, rounds: int) -> tuple[Quartiles, float]:
    """Time of a step [s], and the length of the step [s]."""
    sim = Simulation(load(name), worlds=worlds, seed=3, device=device, threads=1)
    sim.step(steps)
    found = [elapsed(partial(sim.step, steps), device).on(device) / steps for _ in range(rounds)]
    return Quartiles.of(found), sim.time_step


@contextlib.contextmanager
def taking(solver: str) -> Iterator[None]:
    """Simulations that are made within take a solver of `SOLVERS`, whatever their scenes ask for."""
    space, points = SOLVERS[solver]
    rooms: list[Any] = [kernel_module("drivers.world_contacts", p) for p in PRECISIONS]
    steps: list[Any] = [kernel_module("step", p).make_step for p in PRECISIONS]
    kept = model.body_space
    try:
        model.body_space = lambda *_: space
        for room, make in zip(rooms, steps, strict=True):
            room.MAX_POINTS = points
            make.cache_clear()  # equal features would share the kernels of another solver
        yield
    finally:
        model.body_space = kept
        for room, make in zip(rooms, steps, strict=True):
            room.MAX_POINTS = MAX_POINTS
            make.cache_clear()


def delivery(solver: str, modulus: float | None, worlds: int, device: wp.Device, precision: str) -> Simulation:
    """The touching scene with a solver; what a solver cannot settle is kept as a fault and stops nothing."""
    with taking(solver):
        return Simulation(
            load(TOUCHING, modulus), worlds=worlds, seed=3, device=device, threads=1, precision=precision, ends=()
        )


def residuals(
    solver: str, modulus: float | None, device: wp.Device, worlds: int, steps: int, met: int = MET
) -> tuple[np.ndarray, float]:
    """(steps, worlds, bodies) distances [µm] of the places after a step from those of `EXACT` in float64, and the share
    of the worlds that the solver failed in.

    Each step starts from equal places, with the same noise, when the bodies have met.
    """
    single = delivery(solver, modulus, worlds, device, "float32")
    double = delivery(EXACT, modulus, worlds, device, "float64")
    single.step(met)
    double.step(met)  # so that both are at the same step of the noise
    apart = []
    for _ in range(steps):
        for mine, other in zip(
            (double.state.position, double.state.orientation), (single.state.position, single.state.orientation),
            strict=True,
        ):  # fmt: skip
            mine.assign(other.numpy().astype(float))
        single.step(1)
        double.step(1)
        way = single.state.position.numpy().astype(float) - double.state.position.numpy()
        apart.append(np.linalg.norm(way, axis=-1))
    failed = np.any(single.last_readout.fault.numpy() != 0, axis=1)
    return np.array(apart), float(failed.mean())


def phase_times(worlds: int, device: wp.Device, steps: int) -> dict[str, float]:
    """Each phase of a step of the touching scene, by kernel [s], measured on the GPU launch by launch."""
    sim = Simulation(load(TOUCHING), worlds=worlds, seed=3, device=device, threads=1)
    sim.step(MET)
    stepper = sim._stepper
    assert isinstance(stepper, PhasedStepper)
    with wp.ScopedTimer("steps", print=False, synchronize=True, cuda_filter=wp.TIMING_KERNEL) as timer:
        stepper._take_steps(steps)
    found: dict[str, float] = {}
    for event in timer.timing_results:
        # the module's digest ends the name
        name = re.sub("_[0-9a-f]{8}$", "", event.name.removeprefix("forward kernel ").split("__")[-1])
        found[name] = found.get(name, 0.0) + 1e-3 * event.elapsed / steps
    return found


def phase_table(device: wp.Device, worlds: Sequence[int], steps: int) -> tuple[Table, dict[str, Any]]:
    """Phases of a step by numbers of worlds, with what a GPU keeps of each kernel."""
    found = {count: phase_times(count, device, steps) for count in worlds}
    sim = Simulation(load(TOUCHING), worlds=worlds[-1], seed=3, device=device, threads=1)
    assert isinstance(sim._stepper, PhasedStepper)
    memory = kernel_memory(sim._stepper.phases.all, device, load=True) or []
    kept = {row.kernel.split("__")[-1]: row for row in memory}
    rows = [
        (
            name,
            *(f"{1e6 * one[name]:.3g}" for one in found.values()),
            *((f"{row.registers}", f"{row.local}") if (row := kept.get(name)) else ("", "")),
        )
        for name in found[worlds[-1]]
    ]
    table = Table(
        title=f"Phases of a step of `{TOUCHING}` [µs]",
        head=("kernel", *(f"{count:,} worlds" for count in worlds), "registers", "local memory [bytes a thread]"),
        rows=rows,
        note="Sums over the launches of a step, each timed alone; registers and memory are those of the last column of "
        "worlds. What is solved twice counts twice.",
    )
    return table, {str(count): one for count, one in found.items()}


def solver_table(
    device: wp.Device, worlds: int, compared: int, steps: int, rounds: int, moduli: Sequence[str]
) -> tuple[Table, dict[str, Any]]:
    """Each solver on soft and stiff bodies: its time, and its error beside it."""
    rows, data = [], {}
    for about in moduli:
        for name in SOLVERS:
            sim = delivery(name, MODULI[about], worlds, device, "float32")
            sim.step(max(steps, MET))
            took = Quartiles.of(
                [elapsed(partial(sim.step, steps), device).on(device) / steps for _ in range(rounds)]
            ).times(1e6)
            left, failed = residuals(name, MODULI[about], device, compared, 50)
            worst = [float(x) for x in (left.mean(), np.quantile(left, 0.99), left.max())]
            rows.append((about, name, took.text(), *(f"{x:.1e}" for x in worst), f"{100.0 * failed:.3g}"))
            data[f"{about}; {name}"] = {"time_us": vars(took), "mean": worst[0], "largest": worst[2], "failed": failed}
    table = Table(
        title=f"Solvers of the contacts of `{TOUCHING}`: time of a step, and places after it from those in float64",
        head=("moduli", "solver", "time [µs]", "mean [µm]", "99 % [µm]", "largest [µm]", "failed in [% of worlds]"),
        rows=rows,
        note=f"Times of {worlds:,} world{'s' * (worlds > 1)}. Places of {compared} worlds over 50 steps, each from "
        "equal places with the same noise, against body space in float64. A scene chooses its solver by itself; here "
        "each is made to. On a CPU, all but contact space solve up to four contacts of a world for their forces.",
    )
    return table, data


def channel(device: wp.Device, worlds: int, length: float, parts: int) -> list[dict[str, float]]:
    """Parts of the way round the channel: time of a step [s], and bodies in contact at the end of each.

    Args:
        length: How far the fastest cell goes, in lengths of the channel.
    """
    scene = load(CHANNEL)
    assert scene.flow is not None
    sim = Simulation(scene, worlds=worlds, seed=3, device=device, threads=1)
    first = sim.time_step
    sim.step(1)  # kernels are loaded
    each = max(1, round(length * scene.settings.period[0] / scene.flow.speed / first / parts))
    found = []
    for _ in range(parts):
        took = elapsed(partial(sim.step, each), device).on(device) / each
        touching = float((sim.readout.contact_load.numpy() > 0.0).sum(axis=1).mean())
        found.append({"until": sim.time, "time": took, "real_time": worlds * first / took, "touching": touching})
    return found


def measure(
    device: str = "cpu",
    *,
    worlds: Sequence[int] = (),
    steps: int | None = None,
    compared: int = COMPARED,
    rounds: int = 7,
    channels: int | None = None,
    length: float = ROUNDS_OF_CHANNEL,
    parts: int = PARTS,
    moduli: Sequence[str] = tuple(MODULI),
) -> Section:
    """All tables."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    steps = steps or STEPS[kind]
    rows, data = [], {}
    for count in worlds or WORLDS[kind]:
        for name in (APART, TOUCHING):
            took, step = step_time(name, count, place, steps, rounds)
            rows.append((f"`{name}`", f"{count:,}", took.times(1e6).text(), f"{count * step / took.median:.3g}"))
            data[f"{name} {count}"] = vars(took)
    many = channels or CHANNELS[kind]
    way = channel(place, many, length, parts)
    solvers, data["solvers"] = solver_table(place, (worlds or WORLDS[kind])[0], compared, steps, rounds, moduli)
    data["channel"] = way
    tables = [
        Table(
            title="One step, on one core or one GPU",
            head=("scene", "worlds", "time [µs]", "worlds × real time"),
            rows=rows,
        ),
        solvers,
        Table(
            title=f"`{CHANNEL}` from its free start, {many:,} world{'s' * (many > 1)}",
            head=("until [s]", "time of a step [µs]", "worlds × real time", "bodies of 201 in contact"),
            rows=[
                (f"{p['until']:.3g}", f"{1e6 * p['time']:.3g}", f"{p['real_time']:.3g}", f"{p['touching']:.3g}")
                for p in way
            ],
            note=f"Until the fastest cell has gone round the channel {length:g} times; each part is timed as a whole.",
        ),
    ]
    if kind == "cuda":
        phases, data["phases"] = phase_table(place, [n for n in worlds or WORLDS[kind] if n > 1], steps)
        tables.insert(1, phases)
    return Section(name="contact", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(
        measure,
        "Steps of a world whose bodies touch.",
        rounds=7,
        worlds={"type": positive, "nargs": "+", "default": (), "help": "worlds of which a step is timed"},
        channels={"type": positive, "default": None, "help": "worlds of the channel"},
    )
