"""Poses go from the state to a thread's room and back."""

import numpy as np
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BodyConstants
from otwarp.kernels.core.types import StateData, vec6
from otwarp.kernels.drivers.world_room import BodyRoom, load_bodies_term, store_bodies_term
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import quaternions

BODIES, WORLDS = 3, 2
FEATURES = Features(driver="world", bodies=BODIES, rigid=True)
_load, _store = load_bodies_term(FEATURES), store_bodies_term(FEATURES)


@wp.kernel(enable_backward=False)
def shift(state: StateData, way: wp.vec3, turn: wp.quat):
    """Move all bodies of a world by way of its room."""
    world = wp.tid()
    position = wp.zeros(shape=(BODIES,), dtype=wp.vec3)
    rotation = wp.zeros(shape=(BODIES,), dtype=wp.quat)
    linear = wp.zeros(shape=(BODIES,), dtype=wp.vec3)
    angular = wp.zeros(shape=(BODIES,), dtype=wp.vec3)
    free = wp.zeros(shape=(BODIES,), dtype=vec6)
    drift = wp.zeros(shape=(BODIES,), dtype=vec6)
    constants = wp.zeros(shape=(1,), dtype=BodyConstants)
    room = BodyRoom(position, rotation, linear, angular, free, drift, constants)
    _load(state, world, room)
    for b in range(BODIES):
        room.position[b] = room.position[b] + way
        room.rotation[b] = turn * room.rotation[b]
    _store(state, world, room)


def test_what_is_loaded_is_stored_where_it_was(device):
    rng = np.random.default_rng(0)
    place = rng.integers(-8, 8, (WORLDS, BODIES, 3)).astype(np.float32)
    pose = quaternions(rng, WORLDS * BODIES).reshape(WORLDS, BODIES, 4)
    state = StateData()
    state.position = device_array(place, wp.vec3, device, ndim=2)
    state.orientation = device_array(pose, wp.quat, device, ndim=2)
    wp.launch(shift, dim=WORLDS, inputs=[state, wp.vec3(1.0, -2.0, 0.5), wp.quat(0.0, 0.0, 1.0, 0.0)], device=device)
    np.testing.assert_array_equal(state.position.numpy(), place + np.array([1.0, -2.0, 0.5]))
    # half a turn about z: (x, y, z, w) becomes (−y, x, w, −z)
    expected = np.stack([-pose[..., 1], pose[..., 0], pose[..., 3], -pose[..., 2]], axis=-1)
    np.testing.assert_allclose(state.orientation.numpy(), expected, atol=1e-7)
