"""Trap terms of the device against their twins: the four laws, the sum over spheres, commands, speed limits."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.bodies.rigid import rigid_constants_term
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData
from otwarp.kernels.optics.trap_wrench import wrench_term
from otwarp.kernels.optics.traps import TRAP_TERMS, commanded_animated, limited_focus, trap_force_term
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Scene, Sphere, Track, Trap
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, State
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference import keyframes, traps
from tests.reference.rotations import exponential

ROUNDING = 5e-6
"""float32 forces relative to the largest: some ten operations of 6e-8 each, and subtraction of nearby coordinates."""

RADIAL = TrapLaw(stiffness=20.0, threshold=0.5, inverse_square=3.0, offset=-1.0, cutoff=1.5, power=20.0)
AXIAL = TrapLaw(stiffness=6.0, threshold=0.8, inverse_square=4.0, offset=-0.5, cutoff=2.2, power=15.0)
FITTED = 1.5
"""Sphere radius for which two of the laws were fitted [µm]; they meet spheres of other radii below."""


def law(base: TrapLaw, radius: float) -> TrapLaw:
    return dataclasses.replace(base, radius=radius)


def trap(i: int, model: str, axial: TrapLaw | None, *, radius: float = 0.0, **more) -> Trap:
    turn = exponential(np.array([0.4 * i, -0.7, 0.2 * i]))
    return Trap(
        prim=f"/World/Trap{i}",
        position=Track(times=np.array([0.0, 0.4, 1.0]), values=np.array([[i, 0, 0], [i, 0.5, 0.2], [i, -0.5, 0.0]])),
        power=Track(times=np.array([0.0, 0.7]), values=np.array([[20.0], [30.0 + i]])),
        orientation=tuple(turn),
        model=model,
        radial=law(RADIAL, radius),
        axial=law(axial, radius) if axial else None,
        equilibrium=0.1 * i,
        **more,
    )


TRAPS = (
    trap(0, "harmonic", None),
    trap(1, "harmonic", AXIAL, radius=FITTED, speed_limit=3.0),
    trap(2, "piecewise", None, radius=FITTED),
    trap(3, "piecewise", AXIAL),
)
SPHERES = tuple(
    Sphere(prim=f"/World/Robot/S{i}", offset=o, radius=r)
    for i, (o, r) in enumerate([((0.0, 0, 0), 1.0), ((1.7, 0, 0.2), 0.8), ((-1.5, 0.4, 0), 0.9), ((0, 1.6, 0), 1.2)])
)
SCENE = Scene(bodies=(Body(prim="/World/Robot", spheres=SPHERES, position=(1.5, 0, 0)),), traps=TRAPS)
MODELS = tuple(name for name in TRAP_TERMS if not name.startswith("table"))


@pytest.fixture(scope="module")
def model(device) -> Model:
    return Model.build(SCENE, device=device)


_, prepare, force_of, _ = trap_force_term(MODELS)


@wp.kernel(enable_backward=False)
def probe_force(
    model: ModelData,
    trap: wp.array(dtype=int),
    away: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    out: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    law = prepare(model.traps, 0, trap[i], radius[i], 0)
    out[i] = force_of(model.traps, law, away[i])


@wp.kernel(enable_backward=False)
def probe_command(
    model: ModelData,
    control: ControlData,
    trap: wp.array(dtype=int),
    time: wp.array(dtype=wp.float64),
    now: wp.array(dtype=wp.vec3),
    command: wp.array(dtype=wp.vec4),
    focus: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    c = commanded_animated(model.traps, control, 0, trap[i], time[i])
    command[i] = c
    focus[i] = limited_focus(model.traps, 0, trap[i], now[i], wp.vec3(c[0], c[1], c[2]), 0.05)


def displacements(rng: np.random.Generator, n: int, radius: np.ndarray) -> np.ndarray:
    """(n, 3): random ones, and ones a little inside and outside every branch of the laws, scaled or not."""
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    edges = np.array([RADIAL.threshold, RADIAL.cutoff, AXIAL.threshold, AXIAL.cutoff])
    length = rng.uniform(0, 2.6, n)
    at_edge = rng.random(n) < 0.5
    scaled = np.where(rng.random(n) < 0.5, radius / FITTED, 1.0)
    length = np.where(at_edge, rng.choice(edges, n) * scaled * (1 + rng.choice([-1e-5, 1e-5], n)), length)
    return (way * length[:, None]).astype(np.float32)


def test_every_law_is_that_of_the_twin(model, device):
    rng, n = np.random.default_rng(0), 4000
    index = rng.integers(0, len(TRAPS), n)
    radius = rng.uniform(0.5, 2.5, n).astype(np.float32)
    away = displacements(rng, n, radius)
    # on the axis and at the trap itself
    away[:20] *= 0.0
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    (got,) = evaluate(probe_force, n, inputs, [wp.vec3], device)
    expected = []
    for i, d, r in zip(index, away.astype(float), radius.astype(float), strict=True):
        t = dataclasses.replace(TRAPS[i], equilibrium=0.0)
        expected.append(traps.sphere_force(t, np.zeros(3), 1.0, d, r))
    expected = np.array(expected)
    assert np.abs(expected).max(axis=0).min() > 0.3  # pN per mW: the samples do feel the traps
    np.testing.assert_array_equal(got[:20], 0.0)
    error = np.abs(got - expected).max(axis=1)
    # beyond a cutoff the components across and along are compared with it after rounding: none lies that near here
    assert error.max() < ROUNDING * np.abs(expected).max()


def test_force_is_zero_from_the_cutoff_on(model, device):
    """F(d) for d just below the cutoff is the branch's value, at and beyond it zero (harmonic: K·d, then zero)."""
    below, at = np.nextafter(np.float32(1.5), np.float32(0)), np.float32(1.5)
    away = np.array([[below, 0, 0], [at, 0, 0], [2 * at, 0, 0]] * 2, dtype=np.float32)
    index = np.array([0, 0, 0, 2, 2, 2])
    radius = np.full(6, FITTED, dtype=np.float32)
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    (got,) = evaluate(probe_force, 6, inputs, [wp.vec3], device)
    np.testing.assert_array_equal(got[[1, 2, 4, 5]], 0.0)
    assert got[0, 0] == pytest.approx(-1.5 * 20 / 20, rel=1e-6)
    assert got[3, 0] == pytest.approx(-(3.0 / 1.5**2 - 1.0) / 20, rel=1e-5)


def test_commands_follow_key_frames_where_told_to(model, device):
    """`follow` bit 0: position, bit 1: power; the others stay as commanded. Then the speed limit of trap 1."""
    control = Control.start(model)
    np.testing.assert_array_equal(control.follow.numpy(), 3)
    control.follow.assign(np.array([0, 1, 2, 3], dtype=np.int32))
    position = np.arange(12.0).reshape(1, 4, 3)
    control.trap_position.assign(position.astype(np.float32))
    control.trap_power.assign(np.array([[1.0, 2.0, 3.0, 4.0]], dtype=np.float32))
    rng, n = np.random.default_rng(1), 400
    index = np.arange(n) % 4
    time = np.concatenate([[-1.0, 0.0, 0.4, 0.7, 1.0, 1.5], rng.uniform(-0.1, 1.2, n - 6)])
    now = (rng.normal(size=(n, 3)) * 0.1).astype(np.float32) + np.where(index == 1, 1.0, 0.0)[:, None].astype(
        np.float32
    )
    inputs = [model.data, control.data()]
    inputs += on_device(device, (index, int), (time, wp.float64), (now, wp.vec3))
    command, focus = evaluate(probe_command, n, inputs, [wp.vec4, wp.vec3], device)
    for i in range(n):
        t, k = TRAPS[index[i]], index[i]
        p = keyframes.interpolate(t.position.times, t.position.values, time[i]) if k in (1, 3) else position[0, k]
        w = keyframes.interpolate(t.power.times, t.power.values, time[i])[0] if k in (2, 3) else k + 1.0
        np.testing.assert_allclose(command[i], [*p, w], atol=2e-6 * max(1, w))
        reached = traps.limited_focus(now[i].astype(float), p, t.speed_limit, 0.05)
        np.testing.assert_allclose(focus[i], reached, atol=2e-6)


def test_wrench_is_the_sum_over_spheres_and_traps(model, device):
    """Eq. 2 of the paper: force and torque of four traps of four kinds on a body of four spheres.

    Some poses are out of reach of some traps, which the kernel skips by a bounding sphere.
    """
    f = model.features
    assert f.trap_models == tuple(sorted(MODELS))
    assert f.rigid
    term, constants_of = wrench_term(f), rigid_constants_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def probe_wrench(
        model: ModelData,
        control: ControlData,
        state: StateData,
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        force: wp.array(dtype=wp.vec3),
        torque: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        body = constants_of(model, control, 0, 0)
        load = term(model, control, state, body, 0, 0, Pose(position[i], rotation[i]), wp.float64(0.25))
        force[i] = load.force
        torque[i] = load.torque

    rng, n = np.random.default_rng(2), 300
    position = (np.array([1.5, 0.0, 0.0]) + rng.normal(size=(n, 3)) * 1.5).astype(np.float32)
    turn = quaternions(rng, n)
    state = State.start(model)
    inputs = [model.data, Control.start(model).data(), state.data()]
    inputs += on_device(device, (position, wp.vec3), (turn, wp.quat))
    force, torque = evaluate(probe_wrench, n, inputs, [wp.vec3, wp.vec3], device)
    # a trap with a speed limit is where the state says, not where it is commanded
    limited = [np.isfinite(t.speed_limit) for t in TRAPS]
    assert any(limited)
    now = [
        (t, t.position.values[0] if held_back else t.position.at(0.25), t.power.at(0.25)[0])
        for t, held_back in zip(TRAPS, limited, strict=True)
    ]
    spheres = [(np.array(s.offset), s.radius) for s in SPHERES]
    expected = [traps.body_wrench(now, p, q, model.reference[0], spheres) for p, q in zip(position, turn, strict=True)]
    expected_force, expected_torque = (np.array([e[i] for e in expected]) for i in range(2))
    assert np.median(np.linalg.norm(expected_force, axis=1)) > 1.0
    # a distance within rounding of a cutoff may fall on the other side of its jump
    far = np.abs(force - expected_force).max(axis=1) > 10 * ROUNDING * np.abs(expected_force).max()
    assert far.sum() <= 1
    np.testing.assert_allclose(force[~far], expected_force[~far], atol=10 * ROUNDING * np.abs(expected_force).max())
    np.testing.assert_allclose(torque[~far], expected_torque[~far], atol=10 * ROUNDING * np.abs(expected_torque).max())


def test_radial_and_axial_curves_of_different_radii_are_refused(device):
    odd = dataclasses.replace(TRAPS[3], radial=law(RADIAL, 1.0))
    with pytest.raises(InputError, match=r"/World/Trap3: ot:trapLaw:axial:radius = 0 µm; allowed: .* 1 µm"):
        Model.build(dataclasses.replace(SCENE, traps=(odd,)), device=device)
