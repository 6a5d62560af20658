"""Commands of traps: key frames and controls; what laws may be given together."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.keyframes import Piece
from otwarp.kernels.core.types import ControlData, ModelData
from otwarp.kernels.optics.traps import TRAP_TERMS, commanded_animated, commanded_still, limited_focus, piece_terms
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Scene, Sphere, Track, Trap
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control
from tests.kernels.samples import evaluate, on_device
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


piece_of, commanded_by_piece = piece_terms(Features())


@wp.kernel(enable_backward=False)
def probe_command(
    model: ModelData,
    control: ControlData,
    trap: wp.array(dtype=int),
    time: wp.array(dtype=wp.float64),
    now: wp.array(dtype=wp.vec3),
    command: wp.array(dtype=wp.vec4),
    focus: wp.array(dtype=wp.vec3),
    by_piece: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    c = commanded_animated(model.traps, control, 0, trap[i], time[i])
    command[i] = c
    # a piece that was found at another time, and may have ended
    piece = piece_of(model.traps, control, trap[i], Piece(), time[(7 * i) % time.shape[0]])
    still = commanded_still(model.traps, control, 0, trap[i], time[i])
    by_piece[i] = commanded_by_piece(model.traps, control, trap[i], piece, still, time[i])
    focus[i] = limited_focus(model.traps, 0, trap[i], now[i], wp.vec3(c[0], c[1], c[2]), 0.05)


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
    command, focus, by_piece = evaluate(probe_command, n, inputs, [wp.vec4, wp.vec3, wp.vec4], device)
    # a product with the inverse time between samples in place of a quotient: float64, rounded to float32
    np.testing.assert_allclose(by_piece, command, rtol=3e-7, atol=3e-7)
    for i in range(n):
        t, k = TRAPS[index[i]], index[i]
        p = keyframes.interpolate(t.position.times, t.position.values, time[i]) if k in (1, 3) else position[0, k]
        w = keyframes.interpolate(t.power.times, t.power.values, time[i])[0] if k in (2, 3) else k + 1.0
        np.testing.assert_allclose(command[i], [*p, w], atol=2e-6 * max(1, w))
        reached = traps.limited_focus(now[i].astype(float), p, t.speed_limit, 0.05)
        np.testing.assert_allclose(focus[i], reached, atol=2e-6)


def test_radial_and_axial_curves_of_different_radii_are_refused(device):
    odd = dataclasses.replace(TRAPS[3], radial=law(RADIAL, 1.0))
    with pytest.raises(InputError, match=r"/World/Trap3: ot:trapLaw:axial:radius = 0 µm; allowed: .* 1 µm"):
        Model.build(dataclasses.replace(SCENE, traps=(odd,)), device=device)
