"""Force tables: the azimuthal decomposition, the error bound, smoothness, what is cached and what is believed."""

import dataclasses
import math
import shutil

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.optics import Beam, ForceTable, Particle, build_table, force, table_cache, trap_properties
from otwarp.optics.table import combine, layer_count, major_axis
from otwarp.optics.table_build import sample_layers, unseen_points

SMALL = Particle(radius=0.5, index=1.52)
BEAM = Beam(numerical_aperture=1.2)

DECOMPOSED = {
    "circular": (Beam(polarization="circular"), 1),
    "left vortex": (Beam(polarization="left", charge=2), 1),
    "x": (Beam(polarization="x", kind="aplanatic"), 2),
    "45": (Beam(polarization="45", kind="sine"), 2),
    "elliptical": (Beam(polarization=(1.0, 0.3 - 0.6j)), 2),
    "linear vortex": (Beam(polarization="y", charge=1), 3),
    "elliptical vortex": (Beam(polarization=(0.2 + 0.1j, 1.0), charge=-2, depth=5.0, glass_index=1.518), 3),
}


@pytest.mark.parametrize("name", DECOMPOSED)
def test_azimuthal_decomposition_is_exact(name):
    """Layers from one or three azimuths give the force at any other, to rounding."""
    beam, layers = DECOMPOSED[name]
    assert layer_count(beam) == layers
    rng, n = np.random.default_rng(1), 40
    rho, z, phi = rng.uniform(0, 2, n), rng.uniform(-2, 2, n), rng.uniform(0, 2 * math.pi, n)
    found = combine(
        sample_layers(lambda p: force(beam, SMALL, p), beam, rho, z), np.cos(phi), np.sin(phi)
    )  # azimuth from the major axis
    angle = phi + major_axis(beam)
    q = force(beam, SMALL, np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=1))
    exact = np.stack(
        [q[:, 0] * np.cos(angle) + q[:, 1] * np.sin(angle), q[:, 1] * np.cos(angle) - q[:, 0] * np.sin(angle), q[:, 2]],
        axis=1,
    )
    assert np.abs(exact).max() > 0.01
    np.testing.assert_allclose(found, exact, atol=1e-13)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(scope="module", params=["bilinear", "bicubic"])
def table(request, folder) -> ForceTable:
    return build_table(BEAM, SMALL, tolerance=1e-2, interpolation=request.param, cache=folder, device="cpu")


def fresh_error(table: ForceTable, count: int, seed: int) -> float:
    """Largest error over the peak on points from a seed that no build uses."""
    points = unseen_points(table, count, np.random.default_rng(seed))
    exact = force(table.beam, table.sphere, points, device="cpu")
    return float(np.linalg.norm(table.force(points) - exact, axis=1).max()) / table.peak


def test_error_bound_holds_on_fresh_points(table):
    assert 0.0 < table.error <= table.tolerance
    assert fresh_error(table, 4000, 99) <= table.tolerance


@pytest.mark.parametrize("polarization", ["x", "45"])
def test_error_bound_holds_for_a_polarized_beam(polarization, folder):
    beam = dataclasses.replace(BEAM, polarization=polarization)
    table = build_table(beam, SMALL, tolerance=1e-2, interpolation="bicubic", cache=folder, device="cpu")
    assert table.layers == 2
    assert fresh_error(table, 4000, 7) <= table.tolerance


VALIDATED = {
    "circular": (Beam(), Particle(radius=1.0)),
    "small": (Beam(numerical_aperture=1.3, polarization="x"), Particle(radius=0.1, index=1.59)),
    "hard edge": (Beam(kind="aplanatic", numerical_aperture=1.2, polarization="45"), Particle(radius=1.0, index=1.59)),
    "cell": (Beam(), Particle(radius=2.5, index=1.38)),
    "vortex": (Beam(kind="sine", charge=1, polarization="x"), Particle(radius=0.5)),
}


@pytest.mark.validate
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("interpolation", ["bilinear", "bicubic"])
@pytest.mark.parametrize("name", VALIDATED)
def test_error_bound_holds_on_many_points(name, interpolation, tolerance, folder, device):
    beam, sphere = VALIDATED[name]
    table = build_table(beam, sphere, tolerance=tolerance, interpolation=interpolation, cache=folder, device=device)
    points = unseen_points(table, 100_000, np.random.default_rng(5))
    exact = force(beam, sphere, points, device=device)
    assert np.linalg.norm(table.force(points) - exact, axis=1).max() <= tolerance * table.peak


def test_force_ends_smoothly_at_the_cutoff(table):
    """Zero beyond, and no jump of value or slope where a level or the table ends."""
    way = np.array([0.6, 0.0, 0.8])
    beyond = np.linspace(1.0, 3.0, 9) * table.cutoff
    np.testing.assert_array_equal(table.force(beyond[:, None] * way), 0.0)
    for edge in [
        0.8 * table.cutoff,
        table.cutoff,
        *(lv.radius for lv in table.levels),
        *(0.8 * lv.radius for lv in table.levels),
    ]:
        h = 1e-4
        at = (edge + h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))[:, None] * way
        q = table.force(at)
        # central slopes on either side differ by curvature × 2h, far below the slope of the field, peak per radius
        if table.interpolation == "bicubic":
            assert np.abs((q[4] - q[3]) - (q[1] - q[0])).max() / h < 2e-2 * table.peak / table.sphere.radius
        assert np.abs(q[3] - q[1]).max() < 1e-2 * table.peak


def test_beyond_the_cutoff_the_force_is_below_the_tolerance(table):
    rng = np.random.default_rng(2)
    way = rng.normal(size=(300, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    q = force(table.beam, table.sphere, way * table.cutoff * rng.uniform(0.8, 3.0, 300)[:, None], device="cpu")
    assert np.linalg.norm(q, axis=1).max() <= table.tolerance * table.peak


def test_table_knows_its_trap(table):
    """Equilibrium, stiffness and escape are those of the exact field; the steepest slope is no less than these."""
    exact = trap_properties(table.beam.with_power(1.0), table.sphere)
    assert table.properties is not None
    assert table.properties.equilibrium == pytest.approx(exact.equilibrium, abs=1e-8)
    np.testing.assert_allclose(table.properties.stiffness, exact.stiffness, rtol=1e-7)
    np.testing.assert_allclose(table.properties.escape_force, exact.escape_force, rtol=1e-9)
    assert table.steepest > 0.99 * max(exact.stiffness)
    at = np.array([[0.0, 0.0, exact.equilibrium]])
    assert np.abs(table.force(at)).max() <= table.tolerance * table.peak


def test_a_sphere_that_is_not_held_has_no_properties(folder):
    beam = Beam(numerical_aperture=0.4)
    table = build_table(beam, Particle(radius=0.5, index=1.59), tolerance=0.05, cache=folder, device="cpu")
    assert table.properties is None
    again = build_table(beam, Particle(radius=0.5, index=1.59), tolerance=0.05, cache=folder, device="cpu")
    assert again.properties is None


def same(a: ForceTable, b: ForceTable) -> bool:
    fields = ("beam", "sphere", "tolerance", "interpolation", "peak", "error", "properties", "steepest")
    return all(getattr(a, f) == getattr(b, f) for f in fields) and all(
        x.radius == y.radius and x.spacing == y.spacing and np.array_equal(x.node, y.node)
        for x, y in zip(a.levels, b.levels, strict=True)
    )


def cached(table: ForceTable, folder) -> ForceTable | None:
    return table_cache.load(folder, table.beam, table.sphere, table.tolerance, table.interpolation)


def test_cache_gives_back_what_was_saved(table, folder):
    again = cached(table, folder)
    assert again is not None
    assert same(again, table)
    # another name of the same polarization, another power: the same table
    jones = dataclasses.replace(table.beam, polarization=(2.0, 2j), power=7.0)
    assert table_cache.load(folder, jones, table.sphere, table.tolerance, table.interpolation) is not None
    assert not list(folder.glob("*.part"))


def test_building_is_deterministic(table):
    again = build_table(BEAM, SMALL, tolerance=1e-2, interpolation=table.interpolation, cache=False, device="cpu")
    assert same(again, table)


@pytest.mark.parametrize("harm", ["cut short", "flipped bit", "encrypted", "empty", "text", "foreign"])
def test_damaged_or_foreign_files_are_rebuilt(harm, table, folder, tmp_path):
    path = table_cache.file_of(tmp_path, table.beam, table.sphere, table.tolerance, table.interpolation)
    source = table_cache.file_of(folder, table.beam, table.sphere, table.tolerance, table.interpolation)
    data = bytearray(source.read_bytes())
    if harm == "cut short":
        data = data[: len(data) // 2]
    elif harm == "flipped bit":
        data[len(data) // 2] ^= 1
    elif harm == "encrypted":
        # the flag in the first entry of the central directory
        data[data.index(b"PK\x01\x02") + 8] |= 1
    elif harm == "empty":
        data = bytearray()
    elif harm == "text":
        data = bytearray(b"not a table\n")
    path.write_bytes(data)
    if harm == "foreign":
        # a sound table, under the name of another
        other = dataclasses.replace(table, sphere=Particle(radius=0.51))
        table_cache.save(tmp_path, other)
        shutil.copy(table_cache.file_of(tmp_path, other.beam, other.sphere, 1e-2, table.interpolation), path)
    assert cached(table, tmp_path) is None
    arguments = {"tolerance": 1e-2, "interpolation": table.interpolation, "cache": tmp_path, "device": "cpu"}
    assert same(build_table(BEAM, SMALL, **arguments), table)
    rebuilt = cached(table, tmp_path)
    assert rebuilt is not None
    assert same(rebuilt, table)


def test_another_version_is_not_believed(table, folder, monkeypatch):
    monkeypatch.setattr(table_cache, "VERSION", table_cache.VERSION + 1)
    assert cached(table, folder) is None


def test_a_cache_that_cannot_be_written_costs_nothing_else(table, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    table_cache.save(blocked / "folder", table)
    assert blocked.read_text() == ""


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1e-6, 0.5, math.nan])
def test_tolerance_out_of_range(tolerance):
    with pytest.raises(InputError, match=r"tolerance is .*; allowed: 1e-05 to 0\.1"):
        build_table(BEAM, SMALL, tolerance=tolerance)


def test_unknown_interpolation():
    with pytest.raises(InputError, match="allowed: bilinear, bicubic"):
        build_table(BEAM, SMALL, interpolation="nearest")  # type: ignore[arg-type]


def test_aberrated_focus_is_found_and_resolved():
    """20 µm below a cover glass the focus lies several µm nearer to the glass; the table, its trap and its error bound
    are those of that place, and the nodes of the quadrature resolve the interface's phase."""
    beam = Beam(numerical_aperture=1.2, depth=20.0, glass_index=1.518)
    assert -0.3 * 20.0 < beam.focus_shift < -0.1 * 20.0
    table = build_table(beam, SMALL, tolerance=2e-2, interpolation="bicubic", cache=False, device="cpu")
    assert table.properties is not None
    assert abs(table.properties.equilibrium - beam.focus_shift) < 1.5
    assert fresh_error(table, 2000, 3) <= table.tolerance


@pytest.mark.parametrize("depth", [50.0, 200.0])
def test_quadrature_resolves_the_interface(depth):
    """Twice the nodes change nothing: the phase of a deep focus oscillates faster than the point's own."""
    from otwarp.optics import exact

    beam = Beam(numerical_aperture=1.2, depth=depth, glass_index=1.518)
    points = np.array([[0.0, 0.0, 0.0], [0.2, 0.1, beam.focus_shift], [0.5, 0.0, 1.0]])
    orders = exact.highest_order(beam.wavenumber * SMALL.radius)
    finer = exact._act(beam, SMALL, points, orders, 2 * exact.quadrature_nodes(orders, 500.0 + beam.aberration))
    np.testing.assert_allclose(force(beam, SMALL, points), finer[:, :3], atol=1e-12)
    np.testing.assert_allclose(force(beam, SMALL, points, device="cpu"), finer[:, :3], atol=1e-12)


def test_a_point_that_pushes_out_sideways_is_no_equilibrium():
    with pytest.raises(InputError, match=r"stable along the axis of this beam only|no stable point"):
        trap_properties(Beam(charge=1), Particle(radius=0.1, index=1.59))
