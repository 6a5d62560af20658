"""The grids of `otwarp bench stability`: what is varied against what, and the cell that each pair of values is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from otwarp.bench.radial_wells import SHAPES
from otwarp.bench.scenes import PLACE
from otwarp.bench.stability.curved import OBSTACLES, curved_gap
from otwarp.bench.stability.gaps import KINDS, PAIRS, contacts_in_box, pair_in_trap
from otwarp.bench.stability.laws import time_in_a_well
from otwarp.bench.stability.mechanical import (
    dragged_bead,
    first_overlap,
    many_spheres,
    pressed_pair,
    pulled_onto,
    trap_jump,
)
from otwarp.bench.stability.moving import blinking, circling, rotor
from otwarp.bench.stability.random_scenes import run_draw
from otwarp.bench.stability.thermal import (
    Effort,
    bead_variance,
    chosen_step,
    long_run,
    resting_height,
    robot_equipartition,
)
from otwarp.bench.stability.verdict import Deviation

Measure = Callable[[], Deviation | None]


@dataclass(frozen=True, kw_only=True)
class StressGrid:
    """One table: cells by row and column.

    Attributes:
        name: For `--grid` and JSON.
        title: What is measured, against which closed form.
        axes: What the rows and the columns are.
        cells: `(effort) -> (row, column, measurement)` in reading order.
        full_only: Not part of `--quick`.
    """

    name: str
    title: str
    axes: tuple[str, str]
    cells: Callable[[Effort], Iterator[tuple[str, str, Measure]]]
    full_only: bool = False


def product(
    measure: Callable[..., Deviation | None], rows: tuple[str, Sequence[Any]], columns: tuple[str, Sequence[Any]]
) -> Callable[[Effort], Iterator[tuple[str, str, Measure]]]:
    """Cells of a measurement over two of its arguments, each given by name and values."""

    def cells(effort: Effort) -> Iterator[tuple[str, str, Measure]]:
        """(row, column, measurement) of every cell."""
        for row in rows[1]:
            for column in columns[1]:
                yield text(row), text(column), partial(measure, effort, **{rows[0]: row, columns[0]: column})

    return cells


def text(value: object) -> str:
    """A value as head of a row or column."""
    return f"{value:.4g}" if isinstance(value, float | int) else str(value)


MODULI = (1e2, 1e3, 1e4, 1e6, 1e8, 3e9)
TEMPERATURES = (0.0, 1.0, 100.0, 298.15, 400.0)
CHOSEN, STABLE = (0.5, 1.0, 2.0, 4.0), (0.9, 0.99, 1.01, 2.0)
"""Time steps over the chosen one, and over the largest stable one."""


def _steps(measure: Callable[..., Deviation], rows: tuple[str, Sequence[Any]]) -> Callable:
    """Cells of a measurement with arguments `factor` and `stable`, over these time steps."""

    def cells(effort: Effort) -> Iterator[tuple[str, str, Measure]]:
        """Row, column and measurement: every row at `CHOSEN` times the chosen step, then `STABLE` times the largest."""
        for row in rows[1]:
            for stable, factors in ((False, CHOSEN), (True, STABLE)):
                for factor in factors:
                    column = f"{factor:g}{' stable' if stable else ''}"
                    yield text(row), column, partial(measure, effort, factor=factor, stable=stable, **{rows[0]: row})

    return cells


def _bead_at(effort: Effort, *, integrator: str, factor: float, stable: bool) -> Deviation:
    """Variance of a bead in a spring at a time step over the chosen or the largest stable one."""
    from otwarp.bench.scenes import bead, scene, spring

    step = chosen_step(scene(bead(), traps=(spring(),)), effort, integrator=integrator)[int(stable)]
    return bead_variance(effort, integrator=integrator, time_step=factor * step)


def _bead_far(effort: Effort, *, distance: float, power: float) -> Deviation:
    """Variance of a bead in a spring this far from the origin."""
    return bead_variance(effort, power=power, place=(PLACE[0] + distance, PLACE[1], PLACE[2]))


def _long_runs(effort: Effort) -> Iterator[tuple[str, str, Measure]]:
    """Longer and longer, with fewer worlds, up to the steps that the effort allows."""
    steps, worlds = 10_000, max(1, effort.worlds // 8)
    while steps <= effort.steps:
        yield f"{steps:.0e} steps", f"{worlds} worlds", partial(long_run, effort, steps=steps, worlds=worlds)
        steps, worlds = 10 * steps, max(1, worlds // 10)


def _draws(effort: Effort) -> Iterator[tuple[str, str, Measure]]:
    for first in range(0, effort.random_scenes, 12):
        for cold in (True, False):
            for seed in range(first, min(first + 12, effort.random_scenes)):
                kind = "0 K" if cold else "with noise"
                yield f"{kind}, {first} + …", str(seed - first), partial(run_draw, effort, seed, cold=cold)


def _laws(effort: Effort) -> Iterator[tuple[str, str, Measure]]:
    """Every integrator at two wanted accuracies, and every law."""
    for integrator in INTEGRATORS:
        for accuracy in (0.01, 0.05):
            for law in SHAPES:
                row = f"{integrator}, {100.0 * accuracy:g} %"
                yield row, law, partial(time_in_a_well, effort, law=law, how=(integrator, accuracy))


INTEGRATORS = ("eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential")
_POWERS = (0.1, 1.0, 10.0, 100.0, 1000.0)

GRIDS: tuple[StressGrid, ...] = (
    StressGrid(
        name="step",
        title="Bead in a spring: ⟨x²⟩ against k_BT/k",
        axes=("integrator", "time step over the chosen and the largest stable one"),
        cells=_steps(_bead_at, ("integrator", INTEGRATORS)),
    ),
    StressGrid(
        name="laws",
        title="Bead in a well of 3 k_BT: mean time until it leaves, against the Smoluchowski equation",
        axes=("integrator, wanted accuracy", "law"),
        cells=_laws,
    ),
    StressGrid(
        name="power",
        title="Bead in a spring, chosen time step: ⟨x²⟩ against k_BT/k; at 0 K the way back against e^(−kt/γ)",
        axes=("temperature [K]", "power [mW]"),
        cells=product(bead_variance, ("temperature", TEMPERATURES), ("power", _POWERS)),
    ),
    StressGrid(
        name="commanded",
        title="Bead in a spring of 20 mW whose power is then commanded: ⟨x²⟩ against k_BT/k",
        axes=("integrator", "commanded power [mW]"),
        cells=product(bead_variance, ("integrator", INTEGRATORS), ("commanded", (5.0, 20.0, 40.0, 80.0, 160.0, 640.0))),
    ),
    StressGrid(
        name="distance",
        title="Bead in a spring far from the origin, chosen time step: ⟨x²⟩ against k_BT/k",
        axes=("distance [µm]", "power [mW]"),
        cells=product(_bead_far, ("distance", (0.0, 1e2, 1e3, 1e4, 1e5)), ("power", _POWERS)),
    ),
    StressGrid(
        name="robot",
        title="Robot in three springs: equipartition of its stiffest mode, unit quaternion",
        axes=("power [mW]", "time step over the chosen and the largest stable one"),
        cells=_steps(robot_equipartition, ("power", (2.0, 20.0, 200.0))),
    ),
    StressGrid(
        name="rotor",
        title="Free rods of touching spheres of 0.1 µm: ⟨n(0)·n(t)⟩ against e^(−2 D_r t)",
        axes=("spheres", "time step over the chosen one"),
        cells=product(rotor, ("length", (2, 3, 6)), ("factor", (0.25, 0.5, 1.0, 2.0))),
    ),
    StressGrid(
        name="rotor-axis",
        title="The same: mean squared displacement of one step along the axis that a rod had at its start",
        axes=("spheres", "time step over the chosen one"),
        cells=product(partial(rotor, along=True), ("length", (2, 3, 6)), ("factor", (0.25, 0.5, 1.0, 2.0))),
    ),
    StressGrid(
        name="circling",
        title="Bead at 0 K in a spring of k·dt/γ = 0.1 that circles: distance from its way over the circle's radius",
        axes=("integrator", "turns in a step"),
        cells=product(
            partial(circling, product=0.1),
            ("integrator", ("heun", "exponential")),
            ("turns", (0.064, 0.2, 0.45, 0.5, 0.9, 1.0, 1.1, 2.5)),
        ),
    ),
    StressGrid(
        name="blinking",
        title="Bead at 0 K in a trap that is on for a part of each step: what is left of its distance",
        axes=("part of a step", "k·dt/γ while on"),
        cells=product(blinking, ("share", (0.1, 0.3, 0.5, 0.9)), ("product", (0.01, 0.05, 0.2))),
    ),
    StressGrid(
        name="drag",
        title="Dragged bead: lag against γv/k",
        axes=("speed [µm/s]", "time step over the chosen and the largest stable one"),
        cells=_steps(dragged_bead, ("speed", (1.0, 100.0, 1e4))),
    ),
    StressGrid(
        name="jump",
        title="Trap that jumps aside: way of the bead against the equation of motion",
        axes=("force", "jump [µm]"),
        cells=product(
            trap_jump, ("law", ("harmonic", "piecewise", "table")), ("jump", (0.0, 0.1, 0.5, 1.0, 2.0, 5.0, 20.0))
        ),
    ),
    StressGrid(
        name="pair",
        title="Two spheres pressed together by 5 pN: contact force and overlap against Hertz, third law",
        axes=("Young's modulus [Pa]", "size ratio"),
        cells=product(pressed_pair, ("modulus", MODULI), ("ratio", (1.0, 3.0, 10.0, 30.0))),
    ),
    StressGrid(
        name="overlap",
        title="Two free spheres of 1 µm that overlap at the start: what is left after 0.5 s, third law",
        axes=("Young's modulus [Pa]", "overlap [µm]"),
        cells=product(
            first_overlap, ("modulus", MODULI), ("overlap", (0.0, 0.001, 0.01, 0.1, 0.3, 0.49, 0.51, 1.0, 2.0))
        ),
    ),
    StressGrid(
        name="floor",
        title="Bead on a floor whose trap jumps below: contact force and overlap against Hertz",
        axes=("Young's modulus [Pa]", "jump [µm]"),
        cells=product(
            partial(pulled_onto, shape="plane"), ("modulus", MODULI), ("jump", (0.0, 0.1, 0.5, 1.0, 2.0, 5.0, 20.0))
        ),
    ),
    StressGrid(
        name="obstacles",
        title="Bead of 10 MPa pulled onto obstacles, box and cylinder 0.1 µm thin: it must not pass",
        axes=("shape", "jump [µm]"),
        cells=product(
            partial(pulled_onto, modulus=1e7),
            ("shape", ("box", "cylinder", "sphere", "capsule")),
            ("jump", (0.0, 0.1, 1.0, 5.0, 20.0)),
        ),
        full_only=True,
    ),
    StressGrid(
        name="crowd",
        title="Beads side by side on a floor, world driver and grid driver: contact force against Hertz",
        axes=("Young's modulus [Pa]", "beads"),
        cells=product(many_spheres, ("modulus", MODULI), ("count", (2, 24, 25, 60))),
        full_only=True,
    ),
    StressGrid(
        name="resting",
        title="Bead with noise that a spring pulls onto a floor: mean height over its standard deviation (Boltzmann)",
        axes=("Young's modulus [Pa]", "centre of the spring below contact [µm]"),
        cells=product(resting_height, ("modulus", MODULI), ("below", (-0.05, 0.0, 0.01, 0.1))),
    ),
    StressGrid(
        name="resting-step",
        title="The same on a floor for a bead of 1 MPa, spring centred where it just touches",
        axes=("temperature [K]", "time step over the chosen one"),
        cells=product(
            partial(resting_height, modulus=1e6, below=0.0),
            ("temperature", TEMPERATURES[1:]),
            ("step", (0.0625, 0.25, 1.0, 4.0)),
        ),
    ),
    StressGrid(
        name="trapped-pair",
        title="Two hard beads with noise in a spring of 20 pN/µm: mean gap over its standard deviation (Boltzmann)",
        axes=("driver", "k·dt/γ"),
        cells=product(pair_in_trap, ("driver", tuple(PAIRS)), ("z", (0.02, 0.05, 0.1, 0.2))),
    ),
    StressGrid(
        name="weak-pair",
        title="The same in a spring of 0.4 pN/µm",
        axes=("driver", "k·dt/γ"),
        cells=product(partial(pair_in_trap, stiffness=0.4), ("driver", tuple(PAIRS)), ("z", (0.02, 0.05, 0.1, 0.2))),
    ),
    StressGrid(
        name="curved",
        title="Hard bead with noise that a spring pulls onto what is curved, k·dt/γ = 0.2: the same",
        axes=("touched", "stiffness of the spring [pN/µm]"),
        cells=product(curved_gap, ("shape", tuple(OBSTACLES)), ("stiffness", (0.4, 4.0, 20.0))),
    ),
    StressGrid(
        name="box",
        title="Eight hard beads with noise in a box, chosen time step: gaps below a step's spread against Metropolis",
        axes=("contacts", "driver"),
        cells=product(contacts_in_box, ("kind", tuple(KINDS)), ("driver", ("world", "body"))),
        full_only=True,
    ),
    StressGrid(
        name="long",
        title="Long runs of a robot in three springs: equipartition at the end, unit quaternion",
        axes=("length", "worlds"),
        cells=_long_runs,
    ),
    StressGrid(
        name="random",
        title="Scenes drawn at random: invariants; at 0 K what halving the time step changes, over the smallest radius",
        axes=("kind, first number", "number"),
        cells=_draws,
    ),
)
"""All grids."""
