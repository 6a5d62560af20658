"""The local model against the simulation's own laws and tables."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import ChainConfig, HandConfig, LowPass
from otwarp.haptics.force import MEMORY, LocalModel, local_model
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw, TableLaw
from otwarp.laws import TrapLaw
from otwarp.scene import description
from otwarp.simulation.model import Model
from tests.kernels.optics.test_trap_laws import displacements, probe_force
from tests.kernels.optics.test_traps import SCENE, TRAPS
from tests.kernels.samples import evaluate, on_device
from tests.reference.rotations import matrix
from tests.reference.tables import BEAMS, made_up_table, probe_points

ROUNDING = 5e-6
"""float32 forces relative to the largest, as in the tests of the kernels."""

TABLE_ROUNDING = 2e-6
"""Float64 interpolation by two orders of summation, of float32 nodes: far below; tables blend in d², not d."""


def per_mw(law: TrapLaw, model: str) -> TrapLaw:
    """What the scene says, at 1 mW; a spring ends where its linear branch does."""
    return dataclasses.replace(law.per_mw(), threshold=law.cutoff if model == "harmonic" else law.threshold)


def law_of(trap: description.Trap, radius: float) -> IsotropicLaw | SplitLaw:
    curves = [per_mw(law, trap.model).for_radius(radius) for law in (trap.radial, trap.axial) if law is not None]
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


CURVE = TrapLaw(stiffness=2.0, threshold=0.5, inverse_square=0.3, offset=-0.1, cutoff=1.5, power=1.0)


def scene(spheres, traps, beat: int = 0) -> SceneFrame:
    return SceneFrame(
        beat,
        0.0,
        tuple(SphereFrame(p, 0) for p in spheres),
        tuple(TrapFrame(n, p, w) for n, (p, w) in enumerate(traps)),
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
    model = local_model(config, {0: (IsotropicLaw(SPRING),)})
    hold = {0: (0.0, 0.0, 0.0)}
    model.refresh(scene([(0.0, 0.0, 0.0)], [((0.0, 0.0, 0.0), 1.0)]), hold)
    model.refresh(scene([(1.0, 0.0, 0.0)], [((0.0, 0.0, 0.0), 1.0)], 1), hold)
    forces = [model.force(0.0, 0.0, 0.0)[0] for _ in range(10)]
    assert forces[-1] == pytest.approx(-1.0 + math.exp(-1.0), rel=1e-9)


SPRING = TrapLaw(stiffness=1.0, threshold=9.0, cutoff=9.0, power=1.0)
"""1 pN/µm at 1 mW."""


def predicted(ways: list[float], *, carried: list[float], later: float = 0.05, anchor: float = 0.3) -> list[float]:
    """Force along x after each state, the hand `later` µm farther than the state's trap; `ways` are of the sphere."""
    model = LocalModel({0: (IsotropicLaw(SPRING),)}, prediction=True)
    out = []
    for beat, (way, far) in enumerate(zip(ways, carried, strict=True)):
        trap = (anchor + far, 0.0, 0.0)
        now = dataclasses.replace(scene([(way, 0.0, 0.0)], [(trap, 1.0)], beat), time=8e-3 * beat)
        assert model.refresh(now, {0: (anchor, 0.0, 0.0)})
        out.append(model.force(far + later, 0.0, 0.0)[0])
    return out


def test_a_sphere_that_follows_its_trap_is_felt_with_its_lag_alone():
    way = [0.1 * n for n in range(20)]
    forces = predicted([0.3 + w - 0.02 for w in way], carried=way)
    # trap − sphere is 0.02; before anything is known of it, it seems to stay
    assert forces[0] == pytest.approx(0.07) and forces[1:] == pytest.approx([0.02] * 19)


def test_a_sphere_that_is_held_stays_and_one_that_was_let_go_follows():
    way = [0.01 * n for n in range(200)]
    held = predicted([0.3] * 200, carried=way)
    assert held == pytest.approx([w + 0.05 for w in way])
    # runs into a wall after 100 states, and is forgotten to have followed
    stopped = predicted([0.3 + min(w, 1.0) for w in way], carried=way)
    missing = [w - 0.95 - f for w, f in zip(way, stopped, strict=True)][101:]
    assert min(missing) >= 0.0 and max(missing) <= 0.05 and missing[50] < 0.05 * MEMORY**50 * 1.01


def test_no_share_is_below_zero_or_above_one():
    way = [0.1 * n for n in range(5)]
    assert predicted([0.3 - w for w in way], carried=way)[-1] == pytest.approx(2.0 * way[-1] + 0.05)
    assert predicted([0.3 + 2.0 * w for w in way], carried=way)[-1] == pytest.approx(-way[-1])


def test_a_hand_at_rest_feels_no_prediction():
    rng = np.random.default_rng(3)
    places = rng.normal(0.3, 0.1, 50).tolist()
    for far in ([0.2] * 50, [0.01 * n for n in range(50)]):
        found = predicted(places, carried=far, later=0.0)
        assert found == pytest.approx([0.3 + f - x for f, x in zip(far, places, strict=True)], abs=1e-15)


def test_noise_hardly_spoils_the_share():
    """The thermal motion of a bead in 10 pN/µm, with the trap at 5 µm/s."""
    rng = np.random.default_rng(4)
    way = [5.0 / 120.0 * n for n in range(1000)]
    places = [0.3 + w + x for w, x in zip(way, rng.normal(0.0, 0.02, 1000), strict=True)]
    share = 1.0 - (np.array(predicted(places, carried=way)) + np.array(places) - np.array(way) - 0.3) / 0.05
    assert share[100:].mean() > 0.97 and share[100:].min() > 0.85


def told(model: LocalModel, place: float, focus: float, time: float, body: int = 0) -> None:
    """A state with a sphere and a trap along x [µm]; the hand's trap began at 0."""
    spheres, traps = (SphereFrame((place, 0.0, 0.0), body),), (TrapFrame(0, (focus, 0.0, 0.0), 1.0),)
    assert model.refresh(SceneFrame(1, time, spheres, traps), {0: (0.0, 0.0, 0.0)})


@pytest.mark.parametrize("smoothing", [1.0, 0.1])
def test_a_state_told_again_teaches_nothing(smoothing):
    """In slow motion the simulation publishes states in which its time has not gone on."""
    once, again = (LocalModel({0: (IsotropicLaw(SPRING),)}, smoothing=smoothing, prediction=True) for _ in range(2))
    for n in range(20):
        for model, times in ((once, 1), (again, 5)):
            for _ in range(times):
                told(model, 0.1 * n, 0.2 * n, 8e-3 * n)
    assert once.shares == again.shares == [[pytest.approx(0.5)]] and once._way == again._way
    # one that stands still while time goes on teaches that it stands
    told(once, 1.9, 4.8, 1.0)
    assert once.shares[0][0] < 0.4


@pytest.mark.parametrize("smoothing", [1.0, 0.1])
@pytest.mark.parametrize("prediction", [True, False])
def test_a_place_that_goes_to_another_body_brings_no_motion_of_its_own(smoothing, prediction):
    """The nearest spheres are told; one that was 6 µm away and is near now did not cross the trap in between."""
    model = LocalModel({0: (IsotropicLaw(SPRING),)}, smoothing=smoothing, prediction=prediction)
    told(model, -6.0, 0.0, 0.0)
    told(model, -5.0, 1.0, 8e-3)
    told(model, 5.0, 2.0, 16e-3, body=1)
    # it is where it was told, however far the hand goes on
    assert [x - model.force(x, 0.0, 0.0)[0] for x in (2.0, 2.5, 3.0)] == pytest.approx([5.0] * 3)


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
