"""Computed optical forces in a simulation: tables against exact forces, thermal motion, time step, what is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from otwarp import Simulation
from otwarp.errors import InputError
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.laws import TrapLaw
from otwarp.optics import Particle, force
from otwarp.scene import Body, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.optics import beam_of
from otwarp.units import BOLTZMANN


@pytest.fixture(autouse=True)
def cache(tmp_path_factory, monkeypatch):
    """One cache of tables for all tests of a session, apart from the user's."""
    folder = tmp_path_factory.getbasetemp() / "tables"
    monkeypatch.setenv("OTWARP_CACHE", str(folder))
    return folder


def bead(name: str = "Bead", place=(0.0, 0.0, 0.0), *, radius=0.5, index=1.45, collides=True) -> Body:
    prim = f"/World/{name}"
    return Body(
        prim=prim,
        position=place,
        spheres=(Sphere(prim=f"{prim}/s", radius=radius, refractive_index=index, collides=collides),),
    )


def trap(name: str = "Trap", place=(0.0, 0.0, 0.0), *, power: float = 20.0, **optical) -> Trap:
    optical = {"model": "table", "tolerance": 1e-2, "interpolation": "bicubic"} | optical
    return Trap(prim=f"/World/{name}", position=Track.constant(place), power=Track.constant(power), **optical)


def test_bead_spreads_as_the_exact_stiffness_says(device):
    """⟨x_i²⟩ = k_B T/k_i, within the 1 % of the time step; σ is 25 nm, where the well is harmonic to 1e-2.

    4 × 1e-2 covers the table's tolerance and the well's curvature; the sample of 20,000 has a standard error of 1e-2.
    """
    scene = Scene(traps=(trap(tolerance=1e-3),), bodies=(bead(),))
    sim = Simulation(scene, worlds=20_000, seed=3, device=device)
    table = sim.model.optics.tables[0]
    stiffness = 20.0 * np.array(table.properties.stiffness)
    relaxation = 6.0 * np.pi * scene.medium.viscosity * 0.5 / stiffness.min()
    sim.set_state(position=np.tile([0.0, 0.0, table.properties.equilibrium], (20_000, 1, 1)))
    sim.run(6.0 * relaxation)
    x = sim.state.position.numpy()[:, 0].astype(float)
    expected = BOLTZMANN * scene.medium.temperature / stiffness
    np.testing.assert_allclose(x.var(axis=0), expected, rtol=4e-2 + 5.0 * (2.0 / 20_000) ** 0.5)
    assert x[:, 2].mean() == pytest.approx(table.properties.equilibrium, abs=5.0 * x[:, 2].std() / 141.0 + 1e-3)


@pytest.mark.parametrize("polarization", ["circular", "x"])
@pytest.mark.parametrize("interpolation", ["bilinear", "bicubic"])
def test_table_follows_the_exact_force_on_the_same_noise(polarization, interpolation, device):
    """Differences of trajectories stay below tolerance × peak force over stiffness."""
    places = {}
    for model in ("table", "exact"):
        optical = trap(model=model, polarization=polarization, interpolation=interpolation)
        sim = Simulation(Scene(traps=(optical,), bodies=(bead(),)), worlds=16, seed=5, device=device, time_step=2e-5)
        sim.step(300)
        places[model] = sim.state.position.numpy()[:, 0]
    table = sim.model.optics.tables[0]
    bound = table.tolerance * table.peak * table.beam.force_scale / min(table.properties.stiffness)
    difference = np.abs(places["table"] - places["exact"]).max()
    assert 0.0 < difference < bound


def test_every_sphere_feels_every_beam_with_its_own_index(device):
    """A bead and a cell in two beams: the readout is the sum of exact forces of each beam on each sphere."""
    beams = (trap("A"), trap("B", (1.5, 0.3, 0.0), power=8.0, numerical_aperture=1.1, polarization="y"))
    # that they could touch is nothing to a step that is not taken
    bodies = (
        bead("Bead", (0.1, 0.0, 0.1), collides=False),
        bead("Cell", (2.2, 0.4, -0.3), radius=0.6, index=1.38, collides=False),
    )
    sim = Simulation(Scene(traps=beams, bodies=bodies), device=device)
    assert len(sim.model.optics.tables) == 4
    got = sim.readout.sphere_force.numpy()[0]
    for i, body in enumerate(bodies):
        sphere = Particle(radius=body.spheres[0].radius, index=body.spheres[0].refractive_index)
        total, allowed = np.zeros(3), 0.0
        for entry, power in zip(beams, (20.0, 8.0), strict=True):
            beam = beam_of(entry, sim.scene.medium)
            away = np.array(body.position) - entry.position.values[0]
            total += force(beam, sphere, away[None])[0] * beam.force_scale * power
            peak = next(t.peak for t in sim.model.optics.tables if t.beam == beam and t.sphere == sphere)
            allowed += 1e-2 * peak * beam.force_scale * power
        assert np.linalg.norm(got[i] - total) < allowed
        assert np.linalg.norm(total) > 5.0 * allowed


def test_equilibrium_reach_and_escape_come_from_the_table(device):
    model = Model.build(Scene(traps=(trap(),), bodies=(bead(),)), device=device)
    table = model.optics.tables[0]
    entry = model.scene.traps[0]
    assert entry.equilibrium == table.properties.equilibrium
    assert entry.radial.cutoff == pytest.approx(table.cutoff + abs(entry.equilibrium))
    assert model.held == ((0, 0),)
    assert model.held_range[0, 0] == max(table.properties.escape_distance) < table.cutoff
    assert model.features.trap_models == ("table_bicubic_upright",)


def test_the_steepest_place_limits_the_step(device):
    """The rim of the well is steeper than its bottom: stability is judged there."""
    scene = Scene(traps=(trap(),), bodies=(bead(radius=1.0, index=1.52),))
    model = Model.build(scene, device=device)
    table = model.optics.tables[0]
    assert table.steepest > 3.0 * table.properties.stiffness[0]
    drag = 6.0 * np.pi * scene.medium.viscosity * 1.0
    stable = 2.0 * drag / (20.0 * table.steepest)
    assert model.scales.largest_stable == pytest.approx(stable, rel=1e-6)
    assert model.time_step == pytest.approx(INTEGRATORS["heun"].rim / 2.0 * stable, rel=1e-3)  # a whole number in a run
    assert model.scales.chosen_by == "steepest slope of a trap's force"
    with pytest.raises(InputError, match="unstable"):
        Model.build(scene, device=device, options=StepOptions(time_step=1.1 * stable))
    fine = Model.build(scene, device=device, options=StepOptions(integrator="eulerMaruyama"))
    assert fine.time_step < 0.3 * model.time_step


def test_a_law_cannot_be_overridden_where_none_is_followed(device):
    with pytest.raises(InputError, match=r"trap_stiffness does not apply to trap /World/Trap.*harmonic or piecewise"):
        Simulation(Scene(traps=(trap(),), bodies=(bead(),)), device=device, parameters={"trap_stiffness": 1.0})


def test_a_beam_that_does_not_hold_a_sphere_still_pushes_it(device):
    scene = Scene(settings=Settings(brownian=False), traps=(trap(numerical_aperture=0.4),), bodies=(bead(index=1.59),))
    sim = Simulation(scene, device=device)
    assert sim.model.optics.tables[0].properties is None
    sim.step(50)
    assert sim.state.position.numpy()[0, 0, 2] > 0.0
    assert describe(scene, device=device)["optics"][0]["stiffness"] is None


def test_a_scene_without_a_sphere_to_act_on_computes_nothing(device):
    ball = dataclasses.replace(bead().spheres[0], trapped=False)
    model = Model.build(Scene(traps=(trap(),), bodies=(dataclasses.replace(bead(), spheres=(ball,)),)), device=device)
    assert model.optics.tables == ()
    assert model.features.trap_models == ()


def test_info_prints_every_pair_once(device):
    traps = (trap("A"), trap("B", (20.0, 0.0, 0.0)), trap("C", (40.0, 0.0, 0.0), model="exact"))
    bodies = (bead("One"), bead("Two", (20.0, 0.0, 0.0)), bead("Cell", (40.0, 0.0, 0.0), radius=0.6, index=1.38))
    rows = describe(Scene(traps=traps, bodies=bodies), device=device)["optics"]
    assert [(r["model"], r["radius"], len(r["traps"])) for r in rows] == [
        ("table", 0.5, 2),
        ("table", 0.6, 2),
        ("exact", 0.5, 1),
        ("exact", 0.6, 1),
    ]
    for row in rows:
        assert 0.0 < row["table_error"] <= row["tolerance"]
        assert len(row["stiffness"]) == 3
        assert len(row["escape_force"]) == 4


@pytest.mark.parametrize("model", ["table", "exact"])
def test_a_checkpoint_continues_bit_for_bit(model, device, tmp_path):
    """What the scene resolves to is not part of what a checkpoint compares: the scene is, as it was authored."""
    source = Path(__file__).parents[2] / "scenes" / "single_bead.usda"
    text = source.read_text().replace('ot:trap:model = "harmonic"', f'ot:trap:model = "{model}"')
    text = text.replace("ot:trap:tolerance = 0.001", "ot:trap:tolerance = 0.01")
    assert f'"{model}"' in text
    file = tmp_path / "bead.usda"
    file.write_text(text)
    sim = Simulation(Scene.load(file), worlds=2, device=device)
    sim.step(20)
    again = Simulation.restore(sim.save(tmp_path / "c.npz"), device=device)
    sim.step(20)
    again.step(20)
    np.testing.assert_array_equal(again.state.position.numpy(), sim.state.position.numpy())


def test_other_kinds_of_spheres_count_for_the_step(device):
    """A small dense bead beside the held cell relaxes faster: the step follows it, not what the trap holds."""
    held, dense = bead("Cell", index=1.38), bead("Dense", (3.0, 0.0, 0.0), radius=0.3, index=1.6)
    model = Model.build(Scene(traps=(trap(),), bodies=(held, dense)), device=device)
    table = model.optics.tables[model.optics.table[0, model.optics.kind(0.3, 1.6)]]
    rate = 20.0 * max(table.properties.stiffness) / (6.0 * np.pi * 0.00089 * 0.3)
    assert rate * model.time_step <= INTEGRATORS["heun"].largest_product(0.01) * (1.0 + 1e-6)


def test_laws_of_other_traps_may_be_overridden(device):
    law = TrapLaw(stiffness=1.0, cutoff=2.0, power=1.0)
    other = Trap(
        prim="/World/Spring",
        position=Track.constant((9.0, 0.0, 0.0)),
        power=Track.constant(1.0),
        model="harmonic",
        radial=law,
    )
    scene = Scene(traps=(trap(), other), bodies=(bead(), bead("B", (9.0, 0.0, 0.0))))
    plain = Model.build(scene, device=device)
    model = Model.build(scene, device=device, parameters={"trap_stiffness": [5.0, 3.0]})
    assert model.values["trap_stiffness"][0, 0] == plain.values["trap_stiffness"][0, 0]
    assert model.values["trap_stiffness"][0, 1] == 3.0
