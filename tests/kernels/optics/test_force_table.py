"""Tabulated forces in a scene: traps turn their tables, and equal pairs of beam and sphere share one."""

import dataclasses

import numpy as np
import pytest

from otwarp import scene
from otwarp.kernels.core.types import ModelData
from otwarp.simulation.model import Model


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


def tilted_scene(cache, monkeypatch, **optical) -> scene.Scene:
    monkeypatch.setenv("OTWARP_CACHE", str(cache))
    turn = np.array([0.2, -0.3, 0.1, 0.9])
    turn /= np.linalg.norm(turn)
    trap = scene.Trap(
        prim="/World/Trap",
        position=scene.Track.constant((1.0, -2.0, 3.0)),
        power=scene.Track.constant(5.0),
        orientation=tuple(turn),
        model="table",
        tolerance=1e-2,
        **optical,
    )
    bead = scene.Body(
        prim="/World/Bead",
        position=(1.3, -2.2, 3.2),
        spheres=(scene.Sphere(prim="/World/Bead/s", radius=0.5, refractive_index=1.45),),
    )
    return scene.Scene(traps=(trap,), bodies=(bead,))


@pytest.mark.thorough
@pytest.mark.parametrize("polarization", ["circular", "45"])
def test_trap_turns_its_table(polarization, cache, monkeypatch, device):
    """The force in the world's axes is that in the beam's frame, turned with the prim, at the trap's power."""
    from otwarp import Simulation
    from otwarp.scene.transforms import rotate

    sim = Simulation(tilted_scene(cache, monkeypatch, polarization=polarization), device=device)
    table = sim.model.optics.tables[0]
    trap = sim.scene.traps[0]
    back = np.array(trap.orientation) * [-1, -1, -1, 1]
    local = rotate(back, np.array([0.3, -0.2, 0.2]))
    expected = rotate(np.array(trap.orientation), table.force(local[None])[0]) * table.beam.force_scale * 5.0
    np.testing.assert_allclose(sim.readout.trap_force.numpy()[0, 0], expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.thorough
def test_equal_pairs_share_a_table(cache, monkeypatch, device):
    """Three traps on two kinds of spheres: one beam twice, so two tables of it and two of the other."""
    base = tilted_scene(cache, monkeypatch)
    first, bead = base.traps[0], base.bodies[0]
    twin_trap = dataclasses.replace(first, prim="/World/B", position=scene.Track.constant((9.0, 0.0, 0.0)))
    other = dataclasses.replace(first, prim="/World/C", numerical_aperture=1.1)
    cell = dataclasses.replace(
        bead,
        prim="/World/Cell",
        position=(9.0, 0.0, 0.0),
        spheres=(scene.Sphere(prim="/World/Cell/s", radius=0.6, refractive_index=1.4),),
    )
    full = dataclasses.replace(base, traps=(first, twin_trap, other), bodies=(bead, cell))
    model = Model.build(full, device=device)
    assert len(model.optics.tables) == 4
    assert model.optics.kinds == ((0.5, 1.45), (0.6, 1.4))
    np.testing.assert_array_equal(model.optics.table[0], model.optics.table[1])
    assert not set(model.optics.table[2]) & set(model.optics.table[0])
    np.testing.assert_array_equal(model.optics.nearest, [0, 1, 0])
    assert isinstance(model.data, ModelData.cls)
