"""Cells of the stress tests about laws: escapes of a bead with the step that otwarp chooses for a wanted accuracy."""

from __future__ import annotations

import numpy as np

from otwarp.bench.radial_wells import RadialWell, solution
from otwarp.bench.stability.thermal import Effort, advance, simulate
from otwarp.bench.stability.verdict import CERTAIN, Defect, Deviation, against

DEPTH = 3.0
"""Of the wells [k_B T]: where the end is near, and most is to be seen of it."""

WATCHED = 2.0
"""Mean escape times for which a bead is watched."""


def time_in_a_well(effort: Effort, *, law: str, how: tuple[str, float]) -> Deviation:
    """Mean time that a bead stays in a well, up to `WATCHED`, against the Smoluchowski equation.

    Args:
        law: Shape of the trap.
        how: Integrator and wanted accuracy.

    Raises:
        Defect: The error is certainly above the wanted accuracy, and above what the step is said to make wrong.
    """
    integrator, accuracy = how
    well, truth = RadialWell(law, DEPTH), solution(law, DEPTH)
    sim = simulate(well.scene(accuracy=accuracy, integrator=integrator), effort, worlds=4 * effort.worlds)
    step = sim.time_step * well.rate
    total = max(1, round(WATCHED * truth.escape / step))
    advance(sim, total)
    steps = sim.readout.escape_step.numpy()[:, 0].astype(float)
    # an escape lies anywhere in its step
    times = np.where(steps < 0.0, total, steps - 0.5) * step
    expected = sim.model.scales.missed.get("escape", 0.0)
    found = against(times, truth.time_until(total * step), predicted=expected)
    allowed = max(accuracy, abs(expected)) + CERTAIN * found.standard_error
    if abs(found.error) > allowed:
        raise Defect(
            f"error {found.error:.3g} ± {found.standard_error:.2g}, wanted {accuracy:g}, predicted {expected:.2g}"
        )
    return found
