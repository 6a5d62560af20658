"""Tabulated forces of the device against their float64 twin, `ForceTable.force`."""

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from otwarp import scene
from otwarp.kernels.core.table_data import BLEND, ForceTableData
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.optics.force_table import table_term
from otwarp.optics import Beam, ForceTable, Sphere
from otwarp.optics import table as twin
from otwarp.optics.table import TableLevel
from otwarp.simulation.arrays import Place
from otwarp.simulation.model import Model
from otwarp.simulation.optics import TrapOptics, pack_tables

ROUNDING = 3e-6
"""float32 interpolation relative to the largest force: cell offsets of 1e-6 of a cell, some twenty operations."""


def made_up_table(beam: Beam, interpolation: str, seed: int) -> ForceTable:
    """Random smooth nodes: any field will do, and layers must not mix."""
    rng = np.random.default_rng(seed)
    levels = []
    for n, intervals in enumerate((24, 10, 7)):
        radius = 2.0 * 2**n
        node = rng.normal(size=(2 * intervals + 3, intervals + 3, twin.layer_count(beam), 3)).astype(np.float32)
        # what every field has: parity about the axis, on which all but the constant part of F_z vanish
        node[:, 0] = np.array([-1.0, -1.0, 1.0], dtype=np.float32) * node[:, 2]
        node[:, 1, :, :2] = 0.0
        node[:, 1, 1:, 2] = 0.0 if interpolation == "bilinear" else -0.5 * node[:, 2, 1:, 2]
        levels.append(TableLevel(radius, radius / intervals, node))
    return ForceTable(
        beam=beam,
        sphere=Sphere(radius=1.0),
        tolerance=1e-3,
        interpolation=interpolation,  # type: ignore[arg-type]
        peak=1.0,
        error=0.0,
        properties=None,
        steepest=1.0,
        levels=tuple(levels),
    )


BEAMS = (
    Beam(polarization="circular", power=1.0),
    Beam(polarization=(1.0, 0.5j), power=1.0),
    Beam(polarization="x", charge=1, power=1.0),
)


def probe_points(rng: np.random.Generator, n: int, cutoff: float) -> np.ndarray:
    """Random points, on the axis, at the focus, and on both sides of every blend."""
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    way[:40, :2] = 0.0
    way[:40, 2] = np.sign(way[:40, 2])
    distance = rng.uniform(0.0, 1.2 * cutoff, n)
    edges = np.concatenate([cutoff / 2.0 ** np.arange(3), 0.8 * cutoff / 2.0 ** np.arange(3)])
    distance[40:340] = rng.choice(edges, 300) * (1.0 + rng.choice([-1e-5, 1e-5], 300))
    points = way * distance[:, None]
    points[:5] = 0.0
    return points.astype(np.float32)


@pytest.mark.parametrize("interpolation", ["bilinear", "bicubic"])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_term_is_that_of_the_twin(interpolation, layers, device):
    tables = tuple(made_up_table(beam, interpolation, seed) for seed, beam in enumerate(BEAMS))
    optics = TrapOptics((), tables, np.zeros((0, 0), dtype=np.int32), np.zeros(0, dtype=int))
    data, _ = pack_tables(optics, Place(wp.get_device(device)))
    term = table_term(interpolation, layers)
    table = layers - 1

    @wp.kernel(module="unique", enable_backward=False)
    def probe(tables: ForceTableData, table: int, place: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        finest = tables.level[tables.level_start[table]]
        out[i] = term(tables, table, finest, place[i][0], place[i][1], place[i][2])

    place = probe_points(np.random.default_rng(layers), 4000, tables[table].cutoff)
    out = wp.zeros(len(place), dtype=wp.vec3, device=device)
    wp.launch(probe, dim=len(place), inputs=[data, table, wp.array(place, dtype=wp.vec3, device=device), out])
    # the twin turns the polarization's major axis to x by itself; the term is given the turned frame
    turn = twin.major_axis(BEAMS[table])
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    expected = tables[table].force(place.astype(float) @ rotation.T) @ rotation * BEAMS[table].force_scale
    error = np.abs(out.numpy() - expected).max(axis=1)
    assert np.abs(expected).max() > 1.0
    # a random field is not continuous in its slope: where rounding moves a point, only by slope × rounding
    assert error.max() < 40.0 * ROUNDING * np.abs(expected).max()
    assert np.median(error) < ROUNDING * np.abs(expected).max()
    np.testing.assert_array_equal(out.numpy()[np.linalg.norm(place, axis=1) > tables[table].cutoff * 1.0001], 0.0)


def test_blend_is_the_twins():
    assert float(BLEND) == twin.BLEND


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
