"""The `world` driver for bodies that carry each other along: drift and noise of all bodies of a world at once.

The same step as in `world`, for what no body can do by itself.
"""

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part, twist
from otwarp.kernels.contact.contact import UNSETTLED
from otwarp.kernels.contact.coupled_solve import carry_gives, solve_coupled_contacts
from otwarp.kernels.contact.solve import lift_gaps
from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.rotation import rotate_by
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.world import Stages, make_step_of
from otwarp.kernels.drivers.world_contacts import bounded, find_contacts_term
from otwarp.kernels.drivers.world_room import BodyRoom, CarryRoom, ContactRoom, Found
from otwarp.kernels.hydrodynamics.coupling import coupled_drift_term, fill_root_term, shake_term
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.integrate.schemes import second_look


def predict_all_term(f: Features) -> wp.Function:
    """`predict` of `Stages`: as `predict` of an integrator for one body; `carry.pair` at the start of the step."""
    coupled_drift = coupled_drift_term(f)
    fill_root = fill_root_term(f) if f.brownian else None
    shake = shake_term(f) if f.brownian else None

    @wp.func
    def predict_all(
        model: ModelData, control: ControlData, state: StateData, world: int, body: BodyRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Free moves [µm, rad] of all bodies: coupled drift, and coupled noise of the start of the step."""
        bodies = int(wp.static(f.bodies))
        coupled_drift(
            model, control, state, world, body.position, body.rotation, time, carry.pair, carry.force, body.drift
        )
        for b in range(bodies):
            body.free[b] = body.drift[b]
        if wp.static(f.brownian):
            fill_root(model, world, body.rotation, carry.pair, carry.root)
            shake(model, world, body.rotation, carry.root, step, body.free)
        for b in range(bodies):
            body.linear[b] = linear_part(body.free[b])
            body.angular[b] = angular_part(body.free[b])

    return predict_all


def correct_all_term(f: Features) -> wp.Function | None:
    """`correct` of `Stages`: Heun's, for all bodies."""
    if INTEGRATORS[f.integrator].correct is None:
        return None
    coupled_drift = coupled_drift_term(f)
    end_of = second_look(f.leaps)

    @wp.func
    def correct_all(
        model: ModelData, control: ControlData, state: StateData, world: int, body: BodyRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Moves + ½ (a(x + moved) − a(x)) dt [µm, rad] of all bodies, as `correct_heun`."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            carry.there[b] = body.position[b] + body.linear[b]
            carry.turned[b] = body.rotation[b]
            if wp.static(f.rigid):
                carry.turned[b] = rotate_by(body.rotation[b], body.angular[b])
        # the noise has been drawn, so its factor makes room for the pairs at the end of the step
        coupled_drift(
            model, control, state, world, carry.there, carry.turned, end_of(model, time), carry.root, carry.force,
            carry.later,
        )  # fmt: skip
        for b in range(bodies):
            w = angular_part(carry.later[b])
            back = twist(linear_part(carry.later[b]), w - 0.5 * wp.cross(body.angular[b], w))
            more = 0.5 * (back - body.drift[b])
            move = body.free[b] + more
            if wp.static(f.bends):
                # as in `world.correct_all_term`
                body.drift[b] = body.free[b] - twist(body.linear[b], body.angular[b]) - more
            body.linear[b] = linear_part(move)
            body.angular[b] = angular_part(move)

    return correct_all


def find_coupled_term(f: Features) -> wp.Function:
    """`find` of `Stages`: the gaps of contacts also give way by what carries their bodies along."""
    find_contacts = find_contacts_term(f)

    @wp.func
    def find_coupled(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ) -> Found:  # fmt: skip
        """Contacts as without coupling, their gives [µm/pN] then with what is carried along."""
        found = find_contacts(model, readout, world, body, room, carry, step, time)
        carry_gives(room.listed.whole, found.count, carry.pair)
        return found

    return find_coupled


def settle_coupled_term(f: Features) -> wp.Function:
    """`settle` of `Stages`: contacts carry all bodies along."""

    @wp.func
    def settle_coupled(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        found: Found, again: bool, step: wp.int64,
    ):  # fmt: skip
        """Solve the contacts and add their moves [µm, rad]; a fault where the solution errs by over `UNSETTLED`."""
        count = found.count
        if count == 0:
            return
        bodies = int(wp.static(f.bodies))
        sane = bounded(bodies, body)
        contacts = room.listed.whole
        if wp.static(f.bends):
            if wp.static(f.brownian) or again:
                lift_gaps(contacts, count, body.free, body.drift)
        error = solve_coupled_contacts(
            contacts, count, bodies, carry.pair, body.linear, body.angular, room.solve.matrix, room.solve.gap,
            room.solve.right, room.solve.pivot, room.solve.order, room.solve.on,
        )  # fmt: skip
        if error > UNSETTLED * contacts[0].radius and sane:
            raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)

    return settle_coupled


def make_coupled_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that carry each other along, and may touch."""
    stages = Stages(
        predict=predict_all_term(f),
        correct=correct_all_term(f),
        find=find_coupled_term(f) if f.contacts else None,
        settle=settle_coupled_term(f) if f.contacts else None,
    )
    return make_step_of(f, stages)
