"""The step sees where beads leave traps, as far as they come there."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from otwarp.bench.radial_wells import RadialWell
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Flow, Scene
from otwarp.simulation.model import Model
from otwarp.simulation.time_step.edges import LATE, REACHED, reached_power
from otwarp.simulation.time_step.observables import CLOSE
from tests.simulation.setups import line

PAPER = "the paper's radial law"
FALL = 2.0 * 16.18 / 0.08**3 / 12000.0
"""Slope with which the paper's law begins to fall over that with which it rises."""


WHOLE = 5e-3
"""By how much a step is shortened so that a run is a whole number of them, and the paper's branches do not join."""


def product(scene: Scene, well: RadialWell) -> float:
    """k·dt/γ that otwarp chooses."""
    return Model.build(scene, device="cpu").scales.time_step * well.rate


@pytest.mark.parametrize("accuracy", [0.001, 0.01, 0.05])
@pytest.mark.parametrize("name", ["heun", "exponential"])
def test_the_falling_side_limits_the_step_of_a_shallow_well(name, accuracy):
    """5.3 times as steep as the spring; the step of the spring alone made escapes 10 and 14 % too early."""
    well = RadialWell(PAPER, 5.0)
    found = Model.build(well.scene(accuracy=accuracy, integrator=name), device="cpu").scales
    scheme = INTEGRATORS[name]
    assert found.chosen_by == "force where beads leave a trap"
    # the branch and the spring join to 1e-4 of the force
    assert found.time_step * well.rate == pytest.approx(scheme.rim_product(accuracy, "gaussian") / FALL, rel=WHOLE)
    assert 0.5 * accuracy < found.errors["escape"] < 0.701 * accuracy
    assert not found.missed


def test_a_deep_well_is_a_spring():
    """Nobody climbs 300 k_B T, and a step for escapes would cost three times as much."""
    well = RadialWell(PAPER, 3000.0)
    assert product(well.scene(), well) == pytest.approx(INTEGRATORS["heun"].largest_product(0.01), rel=WHOLE)
    # at the power at which thermal motion just comes to the threshold, the step is that of a spring in a trap that deep
    shallow = RadialWell(PAPER, 30.0)
    assert product(shallow.scene(), shallow) < 0.5 * product(well.scene(), well)


def test_drag_and_a_start_beyond_the_threshold_bring_a_bead_there():
    """What pulls the bead aside lowers the barrier; who starts on the falling side is there already."""
    well = RadialWell(PAPER, 3000.0)
    still = well.scene()
    (bead,) = still.bodies
    x, y, z = bead.position
    off = dataclasses.replace(still, bodies=(dataclasses.replace(bead, position=(x + 0.09, y, z)),))
    assert product(off, well) == pytest.approx(
        INTEGRATORS["heun"].rim_product(0.01, "gaussian") / FALL / CLOSE, rel=1e-2
    )
    # nine tenths of the peak force
    speed = 0.9 * well.rate * 0.08
    flowing = dataclasses.replace(still, flow=Flow(prim="/World/F", kind="uniform", speed=speed))
    assert product(flowing, well) < 0.6 * product(still, well)


def test_reached_power_is_where_pull_and_thermal_motion_add_up_to_the_distance():
    """F/kP + √(2·30·k_B T/kP) = d."""
    k, d, energy = np.array([1.0, 20.0]), np.array([0.08, 1.2]), np.array(4.1e-3)
    for pull in (0.0, 0.7):
        power = reached_power(k, d, energy, np.array(pull))
        np.testing.assert_allclose(pull / (k * power) + np.sqrt(2.0 * REACHED * energy / (k * power)), d, rtol=1e-12)
    assert np.isinf(reached_power(np.zeros(1), d[:1], energy, np.zeros(1)))


def test_jumps_and_ends_count():
    """A spring that ends is steeper there by its end; the square of a jump over k_B T, however steep the rest is."""
    ended = RadialWell("spring with an end", 5.0)
    assert product(ended.scene(), ended) == pytest.approx(0.25 / 3.0, rel=WHOLE)
    jumping = RadialWell("jump up by a half", 8.0)
    start = jumping.bend
    assert product(jumping.scene(), jumping) == pytest.approx(0.25 / (4.0 * (0.5 * start) ** 2), rel=WHOLE)
    # errors of a jump fall as dt^1.5: a tenth of the accuracy takes a step 10^(2/3) times shorter
    finer = product(jumping.scene(accuracy=0.001), jumping)
    assert product(jumping.scene(), jumping) / finer == pytest.approx(10.0 ** (2.0 / 3.0), rel=WHOLE)


@pytest.mark.parametrize("name", ["spring with an end", PAPER])
def test_a_bead_that_starts_close_to_the_end_gets_shorter_steps(name):
    """From 99 % of the way in a spring it survived 1.6 % too rarely, from 80 % in the paper's law 1.4 % too often."""
    well = RadialWell(name, 2.0)
    middle, near = product(well.scene(), well), product(well.scene(0.99 * LATE), well)
    assert near == pytest.approx(middle, rel=WHOLE)
    for start in (1.01 * LATE, 0.8, 0.99):
        assert product(well.scene(start), well) == pytest.approx(middle / CLOSE, rel=2 * WHOLE)
    # a start beside a jump errs as the step itself
    jumping = RadialWell("jump up by a half", 8.0)
    steps = [product(jumping.scene(0.7, accuracy=accuracy), jumping) for accuracy in (0.01, 0.001)]
    assert steps[0] / steps[1] == pytest.approx(10.0, rel=2 * WHOLE)


def test_a_law_without_end_is_left_nowhere():
    scene = RadialWell("spring with an end", 5.0).scene()
    endless = dataclasses.replace(scene.traps[0], radial=dataclasses.replace(scene.traps[0].radial, cutoff=math.inf))  # type: ignore[type-var]
    assert "escape" not in Model.build(dataclasses.replace(scene, traps=(endless,)), device="cpu").scales.errors
    cold = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, brownian=False))
    assert set(Model.build(cold, device="cpu").scales.errors) == {"correlation"}


@pytest.mark.parametrize("name", ["spring with an end", PAPER])
def test_a_trap_that_leaves_its_bead_close_to_the_end_gets_shorter_steps(name):
    """By a steady lag of v·γ/k, and by a jump; with a speed limit, and on a way that is too short, it does not."""
    well = RadialWell(name, 2.0)
    still = well.scene()
    (trap,) = still.traps
    start, reach = trap.position.at(0.0), trap.radial.cutoff

    def moved(way: float, time: float, limit: float = math.inf) -> Scene:
        end = start + np.array([way, 0.0, 0.0])
        track = line((0.0, start), (time, end), (10.0, end))
        return dataclasses.replace(still, traps=(dataclasses.replace(trap, position=track, speed_limit=limit),))

    lasting, middle = 20.0 / well.rate, product(still, well)
    for lag, wanted in ((0.9 * LATE, middle), (1.1 * LATE, middle / CLOSE)):
        speed = lag * reach * well.rate
        assert product(moved(speed * lasting, lasting), well) == pytest.approx(wanted, rel=2 * WHOLE)
        assert product(moved(lag * reach, 1e-3 / well.rate), well) == pytest.approx(wanted, rel=2 * WHOLE)
    # as fast, but not for long; and slower than it is told to
    assert product(moved(0.5 * LATE * reach, 0.5 / well.rate), well) == pytest.approx(middle, rel=2 * WHOLE)
    slow = moved(3.0 * reach, lasting, limit=0.5 * LATE * reach * well.rate)
    assert product(slow, well) == pytest.approx(middle, rel=2 * WHOLE)
