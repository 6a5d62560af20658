"""One free step of the device against its twin: wrench, noise, flow and weight, for a rigid body and a lone sphere."""

import dataclasses
from functools import cache

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData
from otwarp.kernels.integrate.body import as_move, body_dynamics
from otwarp.kernels.integrate.integrators import INTEGRATORS, whole_step
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Flow, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.state import Control, State
from otwarp.units import BOLTZMANN, STANDARD_GRAVITY
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference import body as twin
from tests.reference import philox, traps
from tests.reference.flow import flow_at
from tests.reference.rotations import exponential, matrix

ROUNDING = 2e-5
"""float32 displacement relative to the largest: deviates good to 4e-6, forces to 5e-6, and products of them."""

SEED = 77
LAW = TrapLaw(stiffness=20.0, threshold=0.5, inverse_square=3.0, offset=-1.0, cutoff=1.5, power=20.0)
ROBOT = Body(
    prim="/World/Robot",
    density=2000e-12,
    spheres=tuple(
        Sphere(prim=f"/World/Robot/S{i}", offset=o, radius=r)
        for i, (o, r) in enumerate([((0.0, 0, 0), 1.0), ((2.5, 0, 0.3), 0.8), ((0, 2.0, 0), 1.2)])
    ),
)
BEAD = Body(
    prim="/World/Bead", position=(0.3, -0.2, 0.4), spheres=(Sphere(prim="/World/Bead/S", radius=0.7, collides=False),)
)
TRAP = Trap(prim="/World/T", position=Track.constant((0.2, 0.1, 0.3)), power=Track.constant(12.0), radial=LAW)
FLOW = Flow(
    prim="/World/F", kind="poiseuille", speed=40.0, half_height=9.0, origin=(0.0, 0.0, 0.5),
    orientation=tuple(exponential(np.array([0.2, -0.3, 0.5]))),
)  # fmt: skip
SCENE = Scene(
    bodies=(ROBOT, BEAD), traps=(TRAP,), flow=FLOW, settings=Settings(gravity=True, brownian=True, time_step=2e-4)
)


@pytest.fixture(scope="module")
def model(device) -> Model:
    options = StepOptions(integrator="eulerMaruyama", allow_large_step=True)
    return Model.build(SCENE, worlds=3, seed=SEED, device=device, options=options)


def make_probe(model: Model) -> wp.Kernel:
    # the form that does not expect its noise from a block
    f = dataclasses.replace(model.features, lanes=False)
    constants_of, dynamics = body_dynamics(f)
    move_freely = whole_step(INTEGRATORS[f.integrator], dynamics)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData,
        control: ControlData,
        state: StateData,
        world: wp.array(dtype=int),
        body: wp.array(dtype=int),
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        step: wp.array(dtype=wp.int64),
        linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        time = wp.float64(step[i]) * model.time_step
        pose = Pose(position[i], rotation[i])
        constants = constants_of(model, control, world[i], body[i])
        move = as_move(move_freely(model, control, state, constants, world[i], body[i], pose, step[i], time))
        linear[i] = move.linear
        angular[i] = move.angular

    return probe


def expected_move(model: Model, world: int, b: int, position: np.ndarray, q: np.ndarray, step: int) -> np.ndarray:
    """(6,) linear and angular displacement in world axes, in float64 from the scene alone."""
    body, move = SCENE.bodies[b], mobilities(SCENE)[b]
    orientation = q if b == 0 else np.array([0.0, 0.0, 0.0, 1.0])
    spheres = [(np.array(s.offset), s.radius) for s in body.spheres]
    force, torque = traps.body_wrench(
        [(TRAP, TRAP.position.at(0), 12.0)], position, orientation, move.reference, spheres
    )
    load = np.array([0.0, 0.0, -weight(body)])
    force = force + load
    if b == 0:
        torque = torque + np.cross(matrix(orientation) @ (robot_union()[1] - move.reference), load)
    flows = []
    for offset, radius in spheres:
        point = position + matrix(orientation) @ (offset - move.reference)
        flows.append(flow_at(FLOW, point, radius))
    flow = twin.flow_velocity(
        position, orientation, [o for o, _ in spheres], move.flow_coupling, flows
    )  # fmt: skip
    words = [philox.noise_words(seed=SEED, stream=s, step=step, world=world, body=b) for s in (0, 1)]
    noise = np.concatenate([philox.normals(words[0]), philox.normals(words[1])[:2]])
    if b == 1:
        noise[3:] = 0.0
    delta = twin.free_move(
        twin.to_body(orientation, force, torque if b == 0 else 0 * torque), move.mobility, move.cholesky, noise,
        viscosity=SCENE.medium.viscosity, energy=BOLTZMANN * SCENE.medium.temperature, time_step=2e-4, flow=flow,
    )  # fmt: skip
    r = matrix(orientation)
    return np.concatenate([r @ delta[:3], r @ delta[3:] if b == 0 else np.zeros(3)])


def weight(body: Body) -> float:
    """Weight minus buoyancy [pN]."""
    volume = 4 / 3 * np.pi * 0.7**3 if body is BEAD else robot_union()[0]
    return (body.density - SCENE.medium.density) * volume * STANDARD_GRAVITY


@cache
def robot_union() -> tuple[float, np.ndarray]:
    """Volume [µm³] and centroid [µm] of the robot's union, counted on a grid that is not the model's."""
    h = 0.031
    x, y, z = np.meshgrid(*[np.arange(-2.0, 4.0, h)] * 3, indexing="ij", sparse=True)
    inside = np.zeros((x.size, y.size, z.size), dtype=bool)
    for s in ROBOT.spheres:
        inside |= (x - s.offset[0]) ** 2 + (y - s.offset[1]) ** 2 + (z - s.offset[2]) ** 2 < s.radius**2
    return float(inside.sum()) * h**3, np.array([(axis * inside).sum() for axis in (x, y, z)]) / inside.sum()


def test_free_step_is_that_of_the_twin(model, device):
    """Same words, same displacement: drift, weight, flow and noise of both kinds of body, in any pose and world."""
    assert model.features.rigid
    assert model.features.spheres
    assert model.features.flow == "poiseuille"
    rng, n = np.random.default_rng(0), 200
    world, body, step = rng.integers(0, 3, n), np.arange(n) % 2, rng.integers(0, 2**36, n)
    position = (rng.normal(size=(n, 3)) * 0.8).astype(np.float32)
    rotation = quaternions(rng, n)
    views = [model.data, Control.start(model).data(), State.start(model).data()]
    given = on_device(
        device, (world, int), (body, int), (position, wp.vec3), (rotation, wp.quat), (step, wp.int64)
    )  # fmt: skip
    linear, angular = evaluate(make_probe(model), n, [*views, *given], [wp.vec3, wp.vec3], device)
    got = np.concatenate([linear, angular], axis=1)
    rows = zip(world, body, position.astype(float), rotation.astype(float), step, strict=True)
    expected = np.array([expected_move(model, int(w), int(b), p, q, int(s)) for w, b, p, q, s in rows])
    for b in (0, 1):
        mine = body == b
        for part in (slice(0, 3), slice(3, 6)):
            scale = np.abs(expected[mine, part]).max()
            np.testing.assert_allclose(got[mine, part], expected[mine, part], atol=ROUNDING * scale)
    np.testing.assert_array_equal(got[body == 1, 3:], 0.0)
    assert np.abs(expected[body == 0, 3:]).max() > 1e-3


def test_weight_of_overlapping_spheres_counts_them_once(device):
    """The union's volume: for two coincident spheres that of one, for the bead exactly 4/3 π a³."""
    twice = dataclasses.replace(
        BEAD,
        prim="/World/Twice",
        spheres=(BEAD.spheres[0], dataclasses.replace(BEAD.spheres[0], prim="/World/Bead/Again")),
    )
    built = Model.build(dataclasses.replace(SCENE, bodies=(twice, BEAD)), device=device)
    double, single = built.data.body.weight.numpy()
    assert single == pytest.approx(weight(BEAD), rel=1e-6)
    assert double == pytest.approx(single, rel=2e-3)  # counted on a grid of 96 cells per diameter
