"""The local model against the simulation's own laws and tables."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.haptics.config import ChainConfig, HandConfig
from otwarp.haptics.filters import LowPass
from otwarp.haptics.law import IsotropicLaw, LocalModel, SplitLaw, fitted_for, local_model
from otwarp.haptics.table import TableLaw
from otwarp.haptics.types import SceneNow, SphereNow, TrapLaw, TrapNow
from otwarp.optics import ForceTable
from otwarp.optics.table import major_axis
from otwarp.scene import description
from otwarp.simulation.model import Model
from tests.kernels.samples import evaluate, on_device
from tests.kernels.test_force_table import BEAMS, made_up_table, probe_points
from tests.kernels.test_traps import SCENE, TRAPS, displacements, probe_force
from tests.reference.rotations import matrix

ROUNDING = 5e-6
"""float32 forces relative to the largest, as in the tests of the kernels."""

TABLE_ROUNDING = 2e-6
"""Float64 interpolation by two orders of summation, of float32 nodes: far below; tables blend in d², not d."""


def per_mw(law: description.TrapLaw, model: str) -> TrapLaw:
    """What the scene says, at 1 mW; a spring ends where its linear branch does."""
    threshold = law.cutoff if model == "harmonic" else law.threshold
    return TrapLaw(
        law.stiffness / law.power, threshold, law.inverse_square / law.power, law.offset / law.power, law.cutoff
    )


def law_of(trap: description.Trap, radius: float) -> IsotropicLaw | SplitLaw:
    curves = [
        fitted_for(per_mw(law, trap.model), law.radius, radius) if law.radius else per_mw(law, trap.model)
        for law in (trap.radial, trap.axial)
        if law is not None
    ]
    x, y, z = (float(a) for a in matrix(np.array(trap.orientation))[:, 2])
    if len(curves) == 1:
        return IsotropicLaw(curves[0], (x, y, z), trap.equilibrium)
    return SplitLaw(curves[0], curves[1], (x, y, z), trap.equilibrium)


def test_laws_are_those_of_the_simulation(device):
    """Four traps, turned, with displaced equilibria, some fitted for another radius; every branch and edge."""
    model = Model.build(SCENE, device=device)
    rng, n = np.random.default_rng(0), 2000
    index = rng.integers(0, len(TRAPS), n)
    radius = rng.uniform(0.5, 2.5, n).astype(np.float32)
    away = displacements(rng, n, radius)
    away[:20] *= 0.0
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    (expected,) = evaluate(probe_force, n, inputs, [wp.vec3], device)
    got = []
    for i, d, r in zip(index, away.astype(float), radius.astype(float), strict=True):
        law = law_of(TRAPS[i], float(r))
        # the kernels measure from the equilibrium, the local model from the focus
        ex, ey, ez = (law.equilibrium * a for a in law.axis)
        got.append(law.pull(-ex, -ey, -ez, [(float(d[0]), float(d[1]), float(d[2]))]))
    error = np.abs(np.array(got) - expected).max(axis=1)
    assert np.abs(expected).max(axis=0).min() > 0.3
    assert error.max() < ROUNDING * np.abs(expected).max()


@pytest.mark.parametrize("interpolation", ["bilinear", "bicubic"])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_tables_are_those_of_optics(interpolation, layers):
    beam = BEAMS[layers - 1]
    table: ForceTable = made_up_table(beam, interpolation, layers)
    law = TableLaw.of(table, turn=major_axis(beam))
    points = probe_points(np.random.default_rng(layers), 600, table.cutoff).astype(float)
    expected = table.force(points) * beam.force_scale / beam.power
    got = np.array([law.pull(0.0, 0.0, 0.0, [(float(x), float(y), float(z))]) for x, y, z in points])
    assert np.abs(expected).max() > 1.0
    assert np.abs(got - expected).max() < TABLE_ROUNDING * np.abs(expected).max()


def test_table_turns_with_its_beam():
    """A beam along −X with its polarization along Z: the same force, turned."""
    table = made_up_table(BEAMS[0], "bilinear", 0)
    upright = TableLaw.of(table)
    turned = TableLaw.of(table, side=(0.0, 0.0, 1.0), axis=(-1.0, 0.0, 0.0))
    x, y, z = 0.7, -0.4, 0.9
    fx, fy, fz = upright.pull(0.0, 0.0, 0.0, [(x, y, z)])
    # side → z, axis → −x, and up = axis × side → y
    gx, gy, gz = turned.pull(0.0, 0.0, 0.0, [(-z, y, x)])
    assert (gx, gy, gz) == pytest.approx((-fz, fy, fx), rel=1e-12)
    with pytest.raises(InputError, match="polarization axis"):
        TableLaw.of(table, side=(0.0, 0.0, 1.0))


CURVE = TrapLaw(2.0, 0.5, 0.3, -0.1, 1.5)


def scene(spheres, traps, beat: int = 0) -> SceneNow:
    return SceneNow(
        beat, 0.0, tuple(SphereNow(p, 0) for p in spheres), tuple(TrapNow(n, p, w) for n, (p, w) in enumerate(traps))
    )


def test_sum_over_spheres_and_the_traps_of_a_hand():
    """Eq. 2, powers included; the trap of another hand and a sphere out of reach add nothing."""
    law = IsotropicLaw(CURVE)
    model = LocalModel({0: (law,), 2: (law,)})
    spheres = [(0.3, 0.0, 0.0), (0.0, 0.9, 0.1), (40.0, 0.0, 0.0)]
    traps = [((0.0, 0.0, 0.0), 20.0), ((0.1, 0.0, 0.0), 50.0), ((0.2, 0.5, 0.0), 10.0)]
    assert model.refresh(scene(spheres, traps), {0: traps[0][0], 2: traps[2][0]})
    carried = np.array([0.05, -0.1, 0.2])
    expected = np.zeros(3)
    for n in (0, 2):
        for sphere in spheres:
            d = np.array(sphere) - np.array(traps[n][0]) - carried
            r = np.linalg.norm(d)
            f = 2.0 * r if r < 0.5 else (0.3 / r**2 - 0.1 if r < 1.5 else 0.0)
            expected -= traps[n][1] * f * d / r
    np.testing.assert_allclose(model.force(*carried), expected, rtol=1e-12)


def test_kinds_have_laws_of_their_own():
    weak, strong = IsotropicLaw(CURVE), IsotropicLaw(dataclasses.replace(CURVE, stiffness=6.0))
    model = LocalModel({0: (weak, strong)}, (0, 1))
    model.refresh(scene([(0.1, 0, 0), (0.0, 0.1, 0)], [((0.0, 0.0, 0.0), 1.0)]), {0: (0.0, 0.0, 0.0)})
    assert model.force(0.0, 0.0, 0.0) == pytest.approx((-0.2, -0.6, 0.0))
    with pytest.raises(InputError, match="spheres; allowed: 2"):
        model.refresh(scene([(0.1, 0, 0)], [((0.0, 0.0, 0.0), 1.0)]), {0: (0.0, 0.0, 0.0)})


def test_spheres_glide_to_where_they_are_published():
    """With a pose filter of τ the way left after τ is 1/e."""
    config = HandConfig(traps=(0,), chain=ChainConfig(pose_filter=LowPass.of_time_constant(0.01, 200.0)))
    model = local_model(config, {0: (IsotropicLaw(TrapLaw(1.0, 9.0, 0.0, 0.0, 9.0)),)})
    hold = {0: (0.0, 0.0, 0.0)}
    model.refresh(scene([(0.0, 0.0, 0.0)], [((0.0, 0.0, 0.0), 1.0)]), hold)
    model.refresh(scene([(1.0, 0.0, 0.0)], [((0.0, 0.0, 0.0), 1.0)], 1), hold)
    forces = [model.force(0.0, 0.0, 0.0)[0] for _ in range(10)]
    assert forces[-1] == pytest.approx(-1.0 + math.exp(-1.0), rel=1e-9)


LINEAR = IsotropicLaw(TrapLaw(1.0, 900.0, 0.0, 0.0, 900.0))
"""1 pN/µm: the force at the origin is how far the spheres are to the other side."""


def predicting(*states: SceneNow, smoothing: float = 1.0, carried: float = 1.0, periods: int = 8) -> LocalModel:
    """A model that was told these states, `periods` servo periods apart, in each of which a hand carried its trap."""
    model = LocalModel({0: (LINEAR,)}, smoothing=smoothing, prediction=True)
    x = 0.0
    for n, state in enumerate(states):
        model.refresh(state, {0: (0.0, 0.0, 0.0)})
        for _ in range(periods if n < len(states) - 1 else 0):
            model.force(x, 0.0, 0.0)
            x += carried / periods
    return model


def moving(x: float, time: float, body: int = 0) -> SceneNow:
    return SceneNow(1, time, (SphereNow((x, 0.0, 0.0), body),), (TrapNow(0, (0.0, 0.0, 0.0), 1.0),))


def ahead(model: LocalModel, x: float) -> float:
    """Where the sphere is taken to be [µm], with the trap carried by x."""
    return x - model.force(x, 0.0, 0.0)[0]


def test_spheres_go_on_as_they_went_but_no_farther_than_the_hand():
    model = predicting(moving(0.0, 0.0), moving(0.8, 8e-3))
    assert ahead(model, 1.0) == pytest.approx(0.8)  # a hand that has not moved since
    assert ahead(model, 1.5) == pytest.approx(0.8 + 2 * 0.1)
    assert ahead(model, 1.1) == pytest.approx(0.8 + 0.1)
    assert ahead(model, 1.1) == pytest.approx(0.8 + 0.1)  # no farther than the hand


def test_a_state_told_again_changes_nothing_of_the_prediction():
    once = predicting(moving(0.0, 0.0), moving(0.8, 8e-3))
    again = predicting(moving(0.0, 0.0), moving(0.8, 8e-3))
    for n in range(1, 30):
        if n % 8 == 0:
            again.refresh(moving(0.8, 8e-3), {0: (0.0, 0.0, 0.0)})
        x = 1.0 + 0.05 * n
        assert ahead(again, x) == ahead(once, x)
    for model in (once, again):
        model.refresh(moving(1.6, 16e-3), {0: (0.0, 0.0, 0.0)})
    assert once._velocities == again._velocities
    # one that stands still while time goes on is predicted to stand
    once.refresh(moving(1.6, 24e-3), {0: (0.0, 0.0, 0.0)})
    once.force(3.0, 0.0, 0.0)
    assert ahead(once, 4.0) == pytest.approx(1.6)


@pytest.mark.parametrize("smoothing", [1.0, 0.1])
def test_a_place_that_goes_to_another_body_brings_no_motion_of_its_own(smoothing):
    """The nearest spheres are told; one that was 20 µm away and is near now did not cross the trap in between."""
    model = predicting(moving(-20.0, 0.0), moving(5.0, 8e-3, body=1), smoothing=smoothing, carried=30.0)
    model.force(30.0, 0.0, 0.0)
    assert [ahead(model, 30.0 + n) for n in range(1, 5)] == pytest.approx([5.0] * 4)
    # and then it moves
    model.refresh(moving(5.5, 16e-3, body=1), {0: (0.0, 0.0, 0.0)})
    model.force(40.0, 0.0, 0.0)
    assert ahead(model, 41.0) > 5.0


def test_what_is_not_finite_is_refused_and_changes_nothing():
    model = LocalModel({0: (IsotropicLaw(CURVE),)})
    good = scene([(0.1, 0, 0)], [((0.0, 0.0, 0.0), 1.0)])
    model.refresh(good, {0: (0.0, 0.0, 0.0)})
    before = model.force(0.0, 0.0, 0.0)
    for bad in (
        scene([(math.nan, 0, 0)], [((0.0, 0.0, 0.0), 1.0)]),
        scene([(0.1, 0, 0)], [((0.0, 0.0, 0.0), math.inf)]),
    ):
        assert not model.refresh(bad, {0: (0.0, 0.0, 0.0)})
        assert model.force(0.0, 0.0, 0.0) == before


def test_bad_laws_are_named():
    with pytest.raises(InputError, match="threshold is 2"):
        IsotropicLaw(dataclasses.replace(CURVE, threshold=2.0))
    with pytest.raises(InputError, match="stiffness is nan"):
        IsotropicLaw(dataclasses.replace(CURVE, stiffness=math.nan))
    with pytest.raises(InputError, match="beam axis"):
        IsotropicLaw(CURVE, axis=(0.0, 0.0, 2.0))
    with pytest.raises(InputError, match=r"hand\.traps has 3"):
        local_model(HandConfig(traps=(3,)), {0: (IsotropicLaw(CURVE),)})


def test_a_cut_table_ends_where_optics_ends_it():
    """A trap with a reach fades its table out earlier."""
    table = made_up_table(BEAMS[0], "bilinear", 3).cut(2.4)
    law = TableLaw.of(table)
    points = probe_points(np.random.default_rng(9), 400, table.cutoff).astype(float)
    expected = table.force(points) * BEAMS[0].force_scale / BEAMS[0].power
    got = np.array([law.pull(0.0, 0.0, 0.0, [(float(x), float(y), float(z))]) for x, y, z in points])
    assert np.abs(got - expected).max() < TABLE_ROUNDING * np.abs(expected).max()
    assert law.pull(0.0, 0.0, 0.0, [(0.0, 3.01, 0.0)]) == (0.0, 0.0, 0.0)
