"""What is told to chains between their periods: a new state, to arm or disarm, to begin anew. One module for all."""

import warp as wp

from otwarp.operators.kernels.chain import unstarted
from otwarp.operators.kernels.chain_data import ChainData
from otwarp.operators.kernels.local_model import ModelState
from otwarp.operators.kernels.motion import MotionState
from otwarp.operators.kernels.paper_mode import unheard
from otwarp.operators.kernels.passivity import unspent
from otwarp.operators.kernels.safety import cold_safety
from otwarp.operators.kernels.velocity import VelocityState


@wp.func
def is_meant(worlds: wp.array(dtype=wp.bool), w: int) -> bool:
    """Whether an order is for world w: flags of all worlds [1], or none for all."""
    meant = bool(True)
    if worlds.shape[0] > 0:
        meant = worlds[w]
    return meant


@wp.kernel(enable_backward=False)
def publish(data: ChainData, owner: wp.array(dtype=wp.int32), worlds: wp.array(dtype=wp.bool)):
    """Count a new state, over (worlds, traps); traps that no hand has hold of are commanded where they are.

    `owner` is the hand of each trap, −1 for none.
    """
    w, t = wp.tid()
    if is_meant(worlds, w):
        hand = owner[t]
        free = hand < 0
        if not free:
            free = data.ports.holds[w, hand] == 0
        if free:
            data.ports.commanded[w, t] = data.published.trap[w, t]
        if t == 0:
            data.published.beat[w] = data.published.beat[w] + 1


@wp.kernel(enable_backward=False)
def order(data: ChainData, armed: wp.int32, worlds: wp.array(dtype=wp.bool)):
    """Arm or disarm, over (worlds, hands)."""
    w, h = wp.tid()
    n = w * data.constants.shape[0] + h
    if is_meant(worlds, w):
        safety = data.safety[n]
        safety.wanted = armed
        if armed != 0:
            safety.faulty = 0
            state = data.state[n]
            state.cause = 0
            data.state[n] = state
            data.ports.cause[w, h] = 0
        data.safety[n] = safety


@wp.kernel(enable_backward=False)
def begin(data: ChainData, worlds: wp.array(dtype=wp.bool)):
    """Chains as they are made, disarmed, over (worlds, hands)."""
    w, h = wp.tid()
    n = w * data.constants.shape[0] + h
    if is_meant(worlds, w):
        data.state[n] = unstarted()
        data.motion[n] = MotionState()
        data.velocity[n] = VelocityState()
        data.model[n] = ModelState()
        data.passivity[n] = unspent(data.passivity_constants[h])
        data.safety[n] = cold_safety()
        data.paper[n] = unheard()
        data.ports.force[w, h] = wp.vec3d()
        data.ports.asked[w, h] = wp.vec3d()
        data.ports.energy[w, h] = wp.float64(0.0)
        data.ports.phase[w, h] = 0
        data.ports.holds[w, h] = 0
        data.ports.cause[w, h] = 0
