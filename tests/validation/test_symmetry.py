"""The laws have no preferred direction: a scene that is rotated as a whole runs the same way, rotated.

The noise of a rigid body is drawn in the body's axes, so a rotated robot replays it rotated and the comparison holds
with noise; a lone sphere draws it in the world's axes and is compared without. And two bodies that touch act on each
other with opposite forces and torques, so that nothing pushes the pair.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Flow, Medium, Quat, Scene, Settings, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.reference.rotations import matrix, multiply
from tests.simulation.setups import CELL, FIVE, VISCOSITY, harmonic, neutral, obstacle, robot, sphere_body
from tests.validation.poses import matrices

TURN = np.array([0.36, 0.48, -0.64, 0.48])
"""A unit quaternion; no axis of the scene is carried into another one."""

REPLAY = 1e-6
"""Typical difference after 400 steps: float32 rounding of coordinates of some µm (2e-7) and of unit quaternions."""


def turned_track(track: Track, rotation: np.ndarray) -> Track:
    return dataclasses.replace(track, values=track.values @ rotation.T)


def turned_quaternion(q: Quat) -> Quat:
    x, y, z, w = (float(v) for v in multiply(TURN, np.array(q)))
    return x, y, z, w


def turned(scene: Scene) -> Scene:
    """The scene rotated about the origin by TURN."""
    rotation = matrix(TURN)
    bodies = tuple(
        dataclasses.replace(
            b, position=tuple(rotation @ np.array(b.position)), orientation=turned_quaternion(b.orientation)
        )
        for b in scene.bodies
    )
    traps = tuple(
        dataclasses.replace(
            t, position=turned_track(t.position, rotation), orientation=turned_quaternion(t.orientation)
        )
        for t in scene.traps
    )
    flow = scene.flow and dataclasses.replace(
        scene.flow,
        origin=tuple(rotation @ np.array(scene.flow.origin)),
        orientation=turned_quaternion(scene.flow.orientation),
    )
    obstacles = tuple(
        dataclasses.replace(
            o,
            position=turned_track(o.position, rotation),
            orientation=dataclasses.replace(
                o.orientation, values=np.array([turned_quaternion(tuple(q)) for q in o.orientation.values])
            ),
        )
        for o in scene.obstacles
    )
    return dataclasses.replace(scene, bodies=bodies, traps=traps, flow=flow, obstacles=obstacles)


def split(name: str, position, **more) -> Trap:
    """A harmonic trap half as stiff along its beam."""
    trap = harmonic(name, position, **more)
    assert trap.radial is not None
    return dataclasses.replace(trap, axial=dataclasses.replace(trap.radial, stiffness=10.0))


def robot_scene(temperature: float) -> Scene:
    """A five-element robot in three traps and a shear flow."""
    traps = tuple(split(f"T{i}", np.add(FIVE[k][0], (0.1, 0.2, -0.1)), cutoff=1.5) for i, k in enumerate((0, 3, 4)))
    flow = Flow(prim="/World/F", kind="shear", shear_rate=20.0, origin=(0.0, 0.0, -1.0))
    return Scene(
        medium=Medium(temperature=temperature, viscosity=VISCOSITY),
        bodies=(robot("Robot"),),
        traps=traps,
        flow=flow,
        settings=Settings(time_step=2e-5),
    )


def table_scene() -> Scene:
    """A bead in a tabulated, linearly polarized beam, without noise."""
    trap = Trap(
        prim="/World/T",
        position=Track.constant((0.3, -0.2, 0.1)),
        power=Track.constant(5.0),
        polarization="x",
        model="table",
        tolerance=1e-2,
        interpolation="bicubic",
    )
    bead = sphere_body("Bead", radius=0.5)
    return Scene(bodies=(bead,), traps=(trap,), settings=Settings(time_step=2e-5, brownian=False))


def contact_pair() -> Scene:
    """Two cells pressed together by traps beside a box, without noise to speak of."""
    return Scene(
        medium=Medium(temperature=0.0, viscosity=VISCOSITY),
        bodies=(
            neutral("A", (0.0, 0.0, 0.0), radius=1.5, material=CELL),
            neutral("B", (3.2, 0.3, 0.0), radius=2.0, material=CELL),
        ),
        traps=(split("T0", (0.6, 0.0, 0.2), cutoff=1.5), split("T1", (2.6, 0.3, 0.0), cutoff=1.5)),
        obstacles=(obstacle("Box", "box", (0.0, -2.4, 0.0), (1.0, 1.0, 1.0)),),
        settings=Settings(time_step=2e-5),
    )


SCENES = {
    "robot in traps and shear, with noise": lambda: robot_scene(298.15),
    "bead in a tabulated linear beam": table_scene,
    "two cells and a box in contact": contact_pair,
}


@pytest.mark.parametrize("name", SCENES)
def test_rotated_scene(expect_law, device, name):
    """R·x(t) of a scene is x(t) of the rotated scene.

    Source: isotropy of space; the noise of rigid bodies is replayed rotated.
    """
    scene = SCENES[name]()
    worlds = 8
    plain, other = (Simulation(s, worlds=worlds, seed=131, device=device) for s in (scene, turned(scene)))
    start = plain.state.position.numpy().astype(float).copy()
    for sim in (plain, other):
        sim.step(400)
    x, y = (sim.state.position.numpy().astype(float) for sim in (plain, other))
    moved = np.abs(x - start).max()
    assert moved > 0.05, "something must happen"
    expect_law(f"{name}: largest |R·x − x'| [µm]", (x @ matrix(TURN).T - y), 0.0, REPLAY)
    if plain.model.features.rigid:
        a, b = (matrices(sim.state.orientation.numpy().astype(float)) for sim in (plain, other))
        expect_law(f"{name}: largest element of R·O − O'", matrix(TURN) @ a - b, 0.0, REPLAY)


def test_the_comparison_sees_a_preferred_direction(device):
    """Rotating everything but the flow is another scene, by far."""
    scene = robot_scene(298.15)
    half = dataclasses.replace(turned(scene), flow=scene.flow)
    plain, other = (Simulation(s, worlds=2, seed=131, device=device) for s in (scene, half))
    for sim in (plain, other):
        sim.step(400)
    x, y = (sim.state.position.numpy().astype(float) for sim in (plain, other))
    assert np.abs(x @ matrix(TURN).T - y).max() > 1e4 * REPLAY


def test_contact_pushes_no_pair(expect_law, device):
    """Two cells that overlap part with opposite forces, and Σ γ_i x_i stays where it is.

    Source: Newton's third law in a liquid at rest; Σ γ_i ẋ_i = ΣF = 0.
    """
    first, second = (
        neutral(n, p, radius=r, material=CELL) for n, p, r in (("A", (0, 0, 0), 1.0), ("B", (2.2, 1.4, 0.8), 2.0))
    )
    scene = Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(first, second),
        settings=Settings(brownian=False, time_step=1e-4),
    )
    sim = Simulation(scene, device=device)
    weight = np.array([1.0, 2.0])[:, None]
    before = sim.state.position.numpy()[0].astype(float).copy()
    sim.step(1)
    force = sim.readout.contact_force.numpy()[0].astype(float)
    assert np.abs(force).max() > 1.0
    expect_law("sum of the contact forces over the larger [1]", force.sum(axis=0) / np.abs(force).max(), 0.0, 1e-6)
    sim.step(2000)
    after = sim.state.position.numpy()[0].astype(float)
    assert np.abs(after - before).max() > 0.05
    # the rounding of float32 coordinates
    expect_law("shift of Σγ_i x_i/Σγ_i [µm]", (weight * (after - before)).sum(axis=0) / weight.sum(), 0.0, 1e-6)
