"""The `world` driver for bodies that carry each other along: drift and noise of all bodies of a world at once.

The same step as in `world`, for what no body can do by itself.
"""

import warp as wp

from otwarp.kernels.contact import UNSETTLED, Contact
from otwarp.kernels.coupling import block_count, coupled_drift_term, fill_root_term, shake_term
from otwarp.kernels.coupling_contacts import carry_gives, solve_coupled_contacts
from otwarp.kernels.faults import Fault, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.integrators import INTEGRATORS
from otwarp.kernels.rigid import angular_part, linear_part, twist
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.trap_wrench import move_trap_term
from otwarp.kernels.types import ControlData, ModelData, ReadoutData, StateData, vec6
from otwarp.kernels.world import all_good, bounded, find_contacts_term, report_contacts, take_moves_term


def predict_all_term(f: Features) -> wp.Function:
    """Moves of all bodies as `predict` of an integrator gives one body's, and `pair` at the start of the step."""
    coupled_drift = coupled_drift_term(f)
    fill_root = fill_root_term(f) if f.brownian else None
    shake = shake_term(f) if f.brownian else None

    @wp.func
    def predict_all(
        model: ModelData, control: ControlData, state: StateData, world: int, step: wp.int64, time: wp.float64,
        position: wp.array(dtype=wp.vec3), rotation: wp.array(dtype=wp.quat), pair: wp.array(dtype=wp.mat33),
        root: wp.array(dtype=wp.mat33), force: wp.array(dtype=wp.vec3), drift: wp.array(dtype=vec6),
        free: wp.array(dtype=vec6), linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        """Drift and noise."""
        bodies = int(wp.static(f.bodies))
        coupled_drift(model, control, state, world, position, rotation, time, pair, force, drift)
        for b in range(bodies):
            free[b] = drift[b]
        if wp.static(f.brownian):
            fill_root(model, world, rotation, pair, root)
            shake(model, world, rotation, root, step, free)
        for b in range(bodies):
            linear[b] = linear_part(free[b])
            angular[b] = angular_part(free[b])

    return predict_all


def correct_all_term(f: Features) -> wp.Function:
    """Heun's correction for all bodies: `linear` and `angular` are where they came to, and become the whole moves."""
    coupled_drift = coupled_drift_term(f)

    @wp.func
    def correct_all(
        model: ModelData, control: ControlData, state: StateData, world: int, time: wp.float64,
        position: wp.array(dtype=wp.vec3), rotation: wp.array(dtype=wp.quat), there: wp.array(dtype=wp.vec3),
        turned: wp.array(dtype=wp.quat), pair: wp.array(dtype=wp.mat33), force: wp.array(dtype=wp.vec3),
        drift: wp.array(dtype=vec6), later: wp.array(dtype=vec6), free: wp.array(dtype=vec6),
        linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        """½ (a(x + moved) − a(x)) dt, as `correct_heun`."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            there[b] = position[b] + linear[b]
            turned[b] = rotation[b]
            if wp.static(f.rigid):
                turned[b] = rotate_by(rotation[b], angular[b])
        coupled_drift(model, control, state, world, there, turned, time + model.time_step, pair, force, later)
        for b in range(bodies):
            w = angular_part(later[b])
            back = twist(linear_part(later[b]), w - 0.5 * wp.cross(angular[b], w))
            move = free[b] + 0.5 * (back - drift[b])
            linear[b] = linear_part(move)
            angular[b] = angular_part(move)

    return correct_all


@wp.func
def settle_coupled(
    readout: ReadoutData, world: int, contacts: wp.array(dtype=Contact), count: int, bodies: int,
    pair: wp.array(dtype=wp.mat33), linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    matrix: wp.array(dtype=float), free: wp.array(dtype=float), right: wp.array(dtype=float),
    pivot: wp.array(dtype=float), order: wp.array(dtype=int), on: wp.array(dtype=int), step: wp.int64,
):  # fmt: skip
    """Solve the contacts of a world for the free moves, and add what they move; a fault where there is no solution."""
    sane = bounded(bodies, linear, angular)
    error = solve_coupled_contacts(
        contacts, count, bodies, pair, linear, angular, matrix, free, right, pivot, order, on
    )  # fmt: skip
    if error > UNSETTLED * contacts[0].radius and sane:
        raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)


def make_coupled_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that carry each other along, and may touch: one thread per world for all `steps`."""
    predict_all = predict_all_term(f)
    corrected = INTEGRATORS[f.integrator].correct is not None
    correct_all = correct_all_term(f) if corrected else None
    move_trap = move_trap_term(f) if f.speed_limits else None
    find_contacts = find_contacts_term(f) if f.contacts else None
    take_moves = take_moves_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": f.fast_math})
    def coupled_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
        """Take `steps` steps from `first_step` for the worlds from `first_world` on."""
        world = first_world + wp.tid()
        bodies = int(wp.static(f.bodies))
        position = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        rotation = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.quat)
        linear = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        angular = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        free = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        drift = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        force = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        pair = wp.zeros(shape=(wp.static(block_count(f.bodies)),), dtype=wp.mat33)
        root = wp.zeros(shape=(wp.static(block_count(f.bodies)),), dtype=wp.mat33)
        if wp.static(corrected):
            there = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
            turned = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.quat)
            later = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        for b in range(bodies):
            position[b] = state.position[world, b]
            rotation[b] = wp.quat_identity()
            if wp.static(f.rigid):
                rotation[b] = state.orientation[world, b]
        if wp.static(f.contacts):
            contacts = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=Contact)
            matrix = wp.zeros(shape=(wp.static(f.max_contacts * f.max_contacts),), dtype=float)
            gap = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            right = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            pivot = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            order = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
            on = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            predict_all(
                model, control, state, world, step, time, position, rotation, pair, root, force, drift, free, linear,
                angular,
            )  # fmt: skip
            if wp.static(f.speed_limits):
                for trap in range(model.traps.axis.shape[0]):
                    move_trap(model, control, state, world, trap, time)
            if wp.static(f.contacts):
                count = find_contacts(
                    model, readout, world, position, rotation, linear, angular, contacts, step, time
                )  # fmt: skip
                carry_gives(contacts, count, pair)
                settle_coupled(
                    readout, world, contacts, count, bodies, pair, linear, angular, matrix, gap, right, pivot, order,
                    on, step,
                )  # fmt: skip
            if wp.static(corrected):
                # the noise has been drawn, so its factor makes room for the pairs at the end of the step
                correct_all(
                    model, control, state, world, time, position, rotation, there, turned, root, force, drift, later,
                    free, linear, angular,
                )  # fmt: skip
                if wp.static(f.contacts):
                    settle_coupled(
                        readout, world, contacts, count, bodies, pair, linear, angular, matrix, gap, right, pivot,
                        order, on, step,
                    )  # fmt: skip
            if wp.static(f.contacts):
                if i == steps - 1:
                    report_contacts(readout, world, bodies, contacts, count)
            if not all_good(readout, world, bodies, position, linear, angular, step):
                break
            take_moves(model, control, state, readout, world, position, rotation, linear, angular, step + wp.int64(1))
        for b in range(bodies):
            state.position[world, b] = position[b]
            if wp.static(f.rigid):
                state.orientation[world, b] = rotation[b]

    return coupled_step
