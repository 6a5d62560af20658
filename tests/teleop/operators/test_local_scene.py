"""What a hand feels against what the simulation computes: the same laws, the same spheres."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from otwarp.haptics.core.config import HandConfig
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw, TableLaw
from otwarp.scene import Body, Scene, Sphere
from otwarp.simulation.frame import capture_frame
from otwarp.simulation.simulation import Simulation
from otwarp.teleop.operators import LocalScene, reach_of
from tests.teleop.scenes import three_beads

SCENES = Path(__file__).resolve().parents[3] / "scenes"

ROUNDING = 2e-5
"""Of the largest force: single precision of the simulation's law."""
PLACE = 3e-5
"""Force of the rounding of a place [pN]: float32 at 30 µm from the origin resolves 2e-6 µm, and stiffnesses of a few
spheres in one trap add up to some 10 pN/µm."""
INTERPOLATION = 2e-3
"""Of the largest force: the servo takes the trap's table where the simulation has the exact force; the tolerance of the
table is 1e-3 of the peak."""


def felt_and_computed(file: str, shift: float) -> list[tuple[str, np.ndarray, np.ndarray, type]]:
    """Per trap (model, force in the local model, in the simulation, law), with all traps moved by `shift`.

    Of a shipped scene, or without one of three beads.
    """
    scene = Scene.load(SCENES / file) if file else three_beads()
    sim = Simulation(scene, device="cpu", seed=3)
    sim.step(1)
    moved = sim.readout.trap_position.numpy()[0] + shift * np.array([0.6, -0.3, 0.2])
    sim.control.set(trap_position=moved)
    if sim.state.trap_position.size:  # traps with a speed limit do not leap
        sim.state.trap_position.assign(moved[None].astype(np.float32))
        sim.measure()
    frame = capture_frame(sim)
    traps = range(len(scene.traps))
    local = LocalScene.of(sim.model, traps)
    now = local.now(1, frame)
    out = []
    for t in traps:
        model = local_model(HandConfig(traps=(t,)), local.laws, local.kinds)
        assert model.refresh(now, {t: now.traps[t].position})
        law = local.laws[t][0]
        out.append((scene.traps[t].model, np.array(model.force(0.0, 0.0, 0.0)), frame.trap_force[0, t], type(law)))
    return out


@pytest.mark.parametrize("shift", (0.05, 0.7, 2.0))
@pytest.mark.parametrize("file", ("", "cell_delivery.usda", "teleop_small.usda", "force_models.usda"))
def test_a_hand_feels_the_force_that_acts(file, shift):
    found = felt_and_computed(file, shift)
    largest = max(np.linalg.norm(force) for _, _, force, _ in found)
    assert largest > 0.01 or shift > 1.5  # beyond the reach of three beads' traps
    for model, felt, computed, _ in found:
        tolerance = INTERPOLATION if model == "exact" else ROUNDING
        assert np.linalg.norm(felt - computed) <= tolerance * largest + PLACE, model
    kinds = {"": {IsotropicLaw}, "force_models.usda": {SplitLaw, TableLaw}}.get(file, {SplitLaw})
    assert {law for *_, law in found} == kinds


def test_a_table_is_the_simulations_own():
    """Bicubic as well: another would take half a minute to make, and have an error of its own."""
    scene = three_beads()
    first = dataclasses.replace(scene.traps[0], model="table", interpolation="bicubic", tolerance=3e-2)
    settings = dataclasses.replace(scene.settings, time_step=1e-5)
    scene = dataclasses.replace(scene, traps=(first, *scene.traps[1:]), settings=settings)
    sim = Simulation(scene, device="cpu")
    (law,) = LocalScene.of(sim.model, (0,)).laws[0]
    assert isinstance(law, TableLaw) and law.cubic
    (table,) = sim.model.optics.tables
    assert [list(grid.node) for grid in law.grids] == [level.node.ravel().tolist() for level in table.levels]


def crowd(count: int) -> Scene:
    """A line of equal beads, 3 µm apart, and one of another kind at its far end."""
    beads = tuple(
        Body(
            prim=f"/World/b{n}",
            position=(3.0 * n, 0.0, 5.0),
            spheres=(Sphere(prim=f"/World/b{n}/s", radius=1.0 if n < count - 1 else 1.2, collides=False),),
        )
        for n in range(count)
    )
    return dataclasses.replace(three_beads(), bodies=beads)


def test_a_large_scene_is_cut_to_the_spheres_near_the_hands_and_slots_stay():
    sim = Simulation(crowd(20), device="cpu", allow_large_step=True)
    local = LocalScene.of(sim.model, (1,), slots=4)
    assert local.kinds.count(0) == 4 and local.kinds.count(1) == 1

    def bodies(x: float) -> list[int]:
        sim.control.set(trap_position=(x, 0.0, 5.0))
        return [sphere.body for sphere in local.now(1, capture_frame(sim)).spheres]

    first = bodies(9.0)
    assert set(first[:4]) == {1, 2, 3, 4} or set(first[:4]) == {2, 3, 4, 5}
    second = bodies(13.0)
    assert set(second[:4]) == {3, 4, 5, 6} or set(second[:4]) == {2, 3, 4, 5}
    # a sphere that stays near keeps its place
    for slot, body in enumerate(first[:4]):
        if body in second[:4]:
            assert second[slot] == body
    assert first[4] == second[4] == 19


def test_the_reach_of_a_law():
    sim = Simulation(three_beads(), device="cpu")
    local = LocalScene.of(sim.model, (0, 2))
    assert set(local.laws) == {0, 2} and reach_of(local.laws[0][0]) == pytest.approx(1.2)
