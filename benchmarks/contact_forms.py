"""Some hundred bodies that touch, on a GPU: a step as a kernel for each of its parts, and as one kernel for many steps.

`python -m benchmarks.contact_forms --device cuda:0`
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.contact import CHANNEL, load
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.terms.scenes import SCENES as TERMS
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.kernels.drivers.grid.data import shares_entries
from otwarp.scene import Material, Scene
from otwarp.simulation import model
from otwarp.simulation.simulation import Simulation
from tests.kernels.drivers.grid.test_world import with_robot
from tests.simulation.crowds import crowd, jumbled

FORMS = ("one kernel", "in parts")
"""A block of threads keeps its world for many steps; or each part of a step is a kernel for all worlds."""


def packed() -> Scene:
    """64 spheres of 1 kPa that touch and jostle."""
    base = crowd(jumbled(64, jitter=0.05), temperature=298.15)
    firm = Material(youngs_modulus=1e3, poisson_ratio=0.4)
    return dataclasses.replace(base, bodies=tuple(dataclasses.replace(b, material=firm) for b in base.bodies))


@dataclasses.dataclass(frozen=True)
class Case:
    """A scene, the steps until its bodies have met, and the numbers of worlds in which it is stepped."""

    about: str
    scene: Callable[[], Scene]
    met: int
    worlds: tuple[int, ...]


CASES = {
    "channel": Case(f"`{CHANNEL}`, 201 bodies", partial(load, CHANNEL), 5_000, (1, 64, 256, 512, 768, 1_024, 4_096)),
    "packed": Case("64 spheres of 1 kPa that jostle", packed, 50, (512, 1_024, 1_536, 4_096)),
    "heap": Case("30 cells on a floor, and a robot", with_robot, 100, (512, 1_024, 1_536, 4_096)),
    "beads": Case(
        "64 beads of `otwarp bench terms`, gaps of a tenth of a diameter",
        TERMS["crowd"],
        200,
        (1_024, 1_536, 4_096, 16_384),
    ),
}


@contextlib.contextmanager
def taking(form: str) -> Iterator[None]:
    """Simulations that are made within step in a form of `FORMS`."""
    kept = model.many_in_phases
    try:
        model.many_in_phases = lambda features, *_: form == FORMS[1] and shares_entries(features)
        yield
    finally:
        model.many_in_phases = kept


def timed(case: Case, worlds: int, form: str, device: wp.Device, steps: int, rounds: int) -> dict[str, Any]:
    """Steps of a case in a form of `FORMS`, after those until its bodies have met.

    Returns:
        `took`: quartiles of the time of a step of all worlds [s]; `real_time`: simulated seconds a second, all worlds
        together; `phased`: whether steps are taken in parts; `sweeps`, `worst`: sweeps over the contacts of a world in
        a step, of all worlds on average and of the world of most of them; `touching`: share of the bodies.
    """
    with taking(form):
        sim = Simulation(case.scene(), worlds=worlds, seed=4, device=device, threads=1, allow_large_step=True)
    sim.step(case.met + steps)
    scratch: Any = sim._stepper.scratch
    counted = scratch.entry.sweeps
    first = counted.numpy().astype(int)
    found = [elapsed(partial(sim.step, steps), device).on(device) / steps for _ in range(rounds)]
    took = Quartiles.of(found)
    sweeps = (counted.numpy() - first) / (rounds * steps)
    return {
        "took": took,
        "real_time": worlds * sim.time_step / took.median,
        "phased": sim.model.features.phased,
        "sweeps": float(sweeps.mean()),
        "worst": float(sweeps.max()),
        "touching": float(np.mean(sim.readout.contact_load.numpy() > 0.0)),
    }


def measure(
    device: str = "cuda:0", *, cases: Sequence[str] = tuple(CASES), steps: int = 300, rounds: int = 7
) -> Section:
    """Each case in both forms.

    Raises:
        InputError: A CPU, which has one form alone, or an unknown case.
    """
    place = pick_device(device)
    if not place.is_cuda:
        raise InputError(f"--device is {device}; allowed: a GPU, as cuda:0: a CPU steps such worlds in one form")
    if unknown := [name for name in cases if name not in CASES]:
        raise InputError(f"--cases is {' '.join(unknown)}; allowed: {', '.join(CASES)}")
    rows, data = [], {}
    for name in cases:
        case = CASES[name]
        for worlds in case.worlds:
            one, parts = (timed(case, worlds, form, place, steps, rounds) for form in FORMS)
            rows.append(
                (
                    case.about,
                    f"{worlds:,}",
                    one["took"].times(1e6).text(),
                    parts["took"].times(1e6).text(),
                    f"{parts['took'].median / one['took'].median:.3g}",
                    f"{parts['real_time']:.3g}",
                    f"{100.0 * parts['touching']:.2g}",
                    f"{parts['sweeps']:.3g}",
                    f"{parts['worst']:.3g}",
                )
            )
            data[f"{name} {worlds}"] = {
                form: got | {"took": vars(got["took"])} for form, got in zip(FORMS, (one, parts), strict=True)
            }
    table = Table(
        title="A step, as one kernel for many steps and as a kernel for each part",
        head=(
            *("scene", "worlds", "one kernel [µs]", "in parts [µs]", "parts/one", "worlds × real time, in parts"),
            *("bodies that touch [%]", "sweeps a step", "of the slowest world"),
        ),
        rows=rows,
        note="Each world takes its sweeps over its contacts until they have settled; the slowest world is that of most "
        "sweeps over the whole measurement.",
    )
    return Section(name="contact_forms", kind="cuda", machine=Machine.look(place), tables=[table], data=data)


if __name__ == "__main__":
    command(
        measure,
        "Steps of worlds of some hundred bodies, in both forms.",
        rounds=7,
        cases={"nargs": "+", "default": tuple(CASES), "metavar": "CASE", "help": f"{', '.join(CASES)} (default: all)"},
    )
