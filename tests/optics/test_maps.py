"""Force maps: the field in its plane, and the basin of attraction against flow lines of the exact force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.optics.beam import Beam
from otwarp.optics.curves import Curves, force_curves, plot_curves
from otwarp.optics.field import force
from otwarp.optics.maps import ForceMap, attracted, force_map, plot_map
from otwarp.optics.mie import Particle
from otwarp.optics.models import MODELS, Ladder

SPHERE = Particle(radius=0.5, index=1.59)

CONTOUR_MARGIN = 0.06
"""Distance from the contour [µm] at which flow lines are on either side: the table's error of 1 % of the peak moves it
by a fraction of this where the force is weak."""


@pytest.fixture(scope="module")
def ladder(tmp_path_factory) -> Ladder:
    beam = Beam(numerical_aperture=1.2, polarization="45", power=4.0)
    return Ladder(beam=beam, sphere=SPHERE, tolerance=1e-2, cache=tmp_path_factory.mktemp("tables"))


@pytest.fixture(scope="module")
def found(ladder) -> ForceMap:
    return force_map(ladder, samples=41, basin_samples=31)


def exact_flow(ladder: Ladder, across: float, z: float) -> bool:
    """Whether the exact force carries a sphere from here to the equilibrium; Runge–Kutta of fourth order."""
    c, goal, step = math.sqrt(0.5), ladder.properties.equilibrium, 0.1

    def way(p: np.ndarray) -> np.ndarray:
        q = force(ladder.beam, SPHERE, np.array([[c * p[0], c * p[0], p[1]]]))[0]
        v = np.array([c * (q[0] + q[1]), q[2]])
        return v / np.linalg.norm(v)

    p = np.array([across, z])
    for _ in range(60):
        a = way(p)
        b = way(p + 0.5 * step * a)
        d = way(p + 0.5 * step * b)
        p = p + step / 6.0 * (a + 2.0 * b + 2.0 * d + way(p + step * d))
        if np.hypot(p[0], p[1] - goal) < 0.2:
            return True
        if np.hypot(p[0], p[1] - goal) > 3.5:
            return False
    return False


@pytest.mark.thorough
def test_the_map_shows_the_exact_force_in_the_plane_of_the_major_axis(ladder, found):
    assert found.azimuth == pytest.approx(0.25 * math.pi)
    rows, columns = [5, 20, 33], [3, 20, 28]
    c = math.sqrt(0.5)
    for i, j in zip(rows, columns, strict=True):
        x = found.across[j]
        q = force(ladder.beam, SPHERE, np.array([[c * x, c * x, found.height[i]]]))[0] * ladder.beam.force_scale
        assert found.force[i, j] == pytest.approx([c * (q[0] + q[1]), q[2]], abs=found.faint)
    assert found.force[:, ::-1, 0] == pytest.approx(-found.force[:, :, 0], abs=1e-9)


@pytest.mark.thorough
def test_exact_flow_lines_part_at_the_escape_contour(ladder, found):
    """From just inside the contour the exact force leads home, from just outside it leads away."""
    (line,) = found.escape
    centre = np.array([0.0, found.equilibrium])
    for vertex in line[[len(line) // 4, len(line) // 2, 2 * len(line) // 3]]:
        out = (vertex - centre) / np.linalg.norm(vertex - centre)
        assert exact_flow(ladder, *(vertex - CONTOUR_MARGIN * out))
        assert not exact_flow(ladder, *(vertex + CONTOUR_MARGIN * out))


@pytest.mark.thorough
def test_the_basin_s_rim_downstream_is_where_the_axial_force_turns(ladder, found):
    """On the axis the flow stays on the axis: the rim is the unstable point, Q_z = 0. Upstream light pushes it home."""
    rim = found.equilibrium + found.reach["downstream"]
    below, above = (force(ladder.beam, SPHERE, np.array([[0.0, 0.0, rim + s]]))[0, 2] for s in (-0.05, 0.05))
    assert below < 0.0 < above
    assert found.reach["upstream"] is None


@pytest.mark.thorough
def test_flow_from_beyond_the_table_does_not_return(ladder):
    table = ladder.table
    far = np.array([[0.0, -1.5 * table.cutoff], [0.0, 0.0]])
    assert list(attracted(table, far, region=2.0)) == [False, True]


@pytest.mark.thorough
def test_a_beam_that_holds_nothing_has_a_map_without_contour(tmp_path):
    weak = Ladder(
        beam=Beam(numerical_aperture=0.6), sphere=Particle(radius=0.5, index=2.0), tolerance=0.05, cache=tmp_path
    )
    found = force_map(weak, samples=21)
    assert found.equilibrium is None and found.escape == () and found.reach == {}
    assert np.all(found.force[:, 10, 1] > 0.0)
    plot_map(found, tmp_path / "map.svg")
    assert "<svg" in (tmp_path / "map.svg").read_text()[:1000]
    with pytest.raises(InputError, match="no stable point"):
        force_curves(weak)
    with pytest.raises(ValueError, match="does not hold"):
        attracted(weak.table, np.zeros((1, 2)), region=1.0)


@pytest.fixture(scope="module")
def curves(ladder) -> Curves:
    return force_curves(ladder, samples=81)


@pytest.mark.thorough
def test_curves_hold_every_model_and_their_residuals(ladder, curves):
    assert set(curves.force) == set(MODELS)
    middle = len(curves.distance) // 2
    assert abs(curves.force["exact"]["axial"][middle]) < 1e-6 * curves.peak
    slope = -np.gradient(curves.force["harmonic"]["x"], curves.distance)[middle]
    assert slope == pytest.approx(0.5 * sum(ladder.properties.stiffness[:2]))
    q = curves.residual("table", "x") / ladder.beam.force_scale
    assert curves.rmse("table", ("x",)) == pytest.approx(np.sqrt(np.mean(q**2)))
    assert curves.rmse("table", ("axial", "x", "y")) < 0.1 * curves.rmse("piecewise", ("axial", "x", "y"))


@pytest.mark.thorough
def test_pictures_are_whole_files_or_none(tmp_path, found, curves):
    for draw, what in ((plot_map, found), (plot_curves, curves)):
        path = tmp_path / f"{draw.__name__}.png"
        draw(what, path)
        assert path.read_bytes().startswith(b"\x89PNG")
        with pytest.raises(InputError, match="nowhere"):
            draw(what, tmp_path / "nowhere" / "picture.png")
        with pytest.raises(InputError, match=r"\.png, \.pdf, \.svg"):
            draw(what, tmp_path / "picture.jpeg")
    assert not list(tmp_path.glob(".*"))
