"""Strategy B: with five elements the tilt depends on the power ratio m of the two traps, which a pair's does not.

The traps reach the arms as well as the handles, and their laws have a threshold, so the energy is no longer one
quadratic form times k₁k₂/(k₁ + k₂). No closed form is known; the run without noise is held against the balance of the
reference forces at the pose in which it comes to rest.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from otwarp.scene import Medium, Scene, Settings, Track
from otwarp.simulation.simulation import Simulation
from scenes.author import strategy_b
from tests.reference.traps import body_wrench
from tests.simulation.setups import COLD
from tests.validation.poses import matrices, pose

RATIOS = np.array([1.0, 1.5, 2.5])
SPACING = 0.8
"""d over the span of the handles."""

BALANCE = 1e-3
"""Force and torque left over at rest, over the largest force of a trap (times the half span): float32 positions of some
µm times a stiffness of 20 pN/µm, and what is left of the relaxation."""


@functools.cache
def scene() -> Scene:
    robot = dataclasses.replace(strategy_b.robot(), position=(0.0, 0.0, 0.0))
    # collisions have no partner here
    spheres = tuple(dataclasses.replace(s, collides=False) for s in robot.spheres)
    middle = np.array(strategy_b.robot().position)
    traps = tuple(
        dataclasses.replace(t, position=Track.constant((t.position.values[0] - middle) * [1.0, SPACING, 1.0]))
        for t in strategy_b.traps()
    )
    return Scene(
        medium=Medium(temperature=COLD),
        bodies=(dataclasses.replace(robot, spheres=spheres),),
        traps=traps,
        settings=Settings(accuracy=0.05),
    )


def at_rest(device: str, seconds: float) -> tuple[Simulation, np.ndarray]:
    """The runs, one world per power ratio, and the sine of the tilt of the line of the handles (W,)."""
    one = scene()
    total = strategy_b.TOTAL_POWER
    power = np.stack([total * RATIOS / (1.0 + RATIOS), total / (1.0 + RATIOS)], axis=1)
    sim = Simulation(one, worlds=len(RATIOS), seed=111, device=device, parameters={"trap_power": power})
    tilt = 0.1  # about x, across the line of the handles
    sim.set_state(orientation=np.array([[np.sin(0.5 * tilt), 0.0, 0.0, np.cos(0.5 * tilt)]]))
    sim.run(seconds)
    ends = {s.prim.rsplit("/", 1)[-1]: np.array(s.offset) for s in one.bodies[0].spheres}
    line = ends["handle_left"] - ends["handle_right"]
    return sim, (matrices(pose(sim)[1]) @ (line / np.linalg.norm(line)))[:, 2]


@pytest.mark.thorough
def test_tilt_depends_on_the_power_ratio(expect_law, device):
    """θ at rest differs between m = 1, 1.5 and 2.5, and reference forces vanish in each pose.

    Source: eq. 1 and 2 of the force model, evaluated in float64; compare `test_a_pair_does_not_feel_the_power_ratio`.
    """
    sim, sine = at_rest(device, 6.0)
    one = sim.scene
    body = one.bodies[0]
    spheres = [(np.array(s.offset), s.radius) for s in body.spheres if s.trapped]
    powers = sim.readout.trap_power.numpy().astype(float)
    place, turn = pose(sim)
    largest = np.linalg.norm(sim.readout.trap_force.numpy(), axis=-1).max()
    assert largest > 1.0, "the traps pull against each other"
    span = np.ptp([o[1] for o, _ in spheres])
    left = []
    for w in range(len(RATIOS)):
        foci = [t.position.values[0] for t in one.traps]
        loads = list(zip(one.traps, foci, powers[w], strict=True))
        force, torque = body_wrench(loads, place[w], turn[w], sim.model.reference[0], spheres)
        left.append(np.concatenate([force, torque / (0.5 * span)]) / largest)
    expect_law("reference force and torque at rest, over the traps'", np.array(left), 0.0, BALANCE)
    degrees = np.degrees(np.arcsin(np.abs(sine)))
    print("tilt at m =", RATIOS, ":", np.round(degrees, 2), "degrees")
    assert degrees.min() > 15.0
    assert degrees[0] - degrees[2] > 2.0, "the same pair of traps, other shares of the power"
