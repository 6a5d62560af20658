"""The wrench of all traps on a body: the sum over its spheres, from foci that may lag behind."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.rigid import rigid_constants_term
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData
from otwarp.kernels.forces.total import body_total
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, State
from tests.kernels.optics.test_traps import MODELS, ROUNDING, SCENE, SPHERES, TRAPS
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference import traps


@pytest.fixture(scope="module")
def model(device) -> Model:
    return Model.build(SCENE, device=device)


def test_wrench_is_the_sum_over_spheres_and_traps(model, device):
    """Eq. 2 of the paper: force and torque of four traps of four kinds on a body of four spheres.

    Some poses are out of reach of some traps, which the kernel skips by a bounding sphere.
    """
    f = model.features
    assert f.trap_models == tuple(sorted(MODELS))
    assert f.rigid
    term, constants_of = body_total(f), rigid_constants_term(f)

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
