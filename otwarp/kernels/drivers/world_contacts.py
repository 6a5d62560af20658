"""Contacts of a world of few bodies: found once a step, solved in each stage, and reported."""

import warp as wp

from otwarp.kernels.contact.body_solve import fill_base_term, solve_bodies_term
from otwarp.kernels.contact.contact import UNSETTLED, Contact
from otwarp.kernels.contact.detect import obstacle_contacts_term, pair_contacts_term
from otwarp.kernels.contact.solve import solve_contacts
from otwarp.kernels.contact.travel import free_travel, thermal_reach, wander_of
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData
from otwarp.kernels.drivers.world_room import BodyRoom, CarryRoom, ContactRoom

PUSHED = wp.constant(0.1)
"""How far one body pushes another beyond its own free move in one step at most, relative to its bounding sphere."""


@wp.func
def bounded(bodies: int, body: BodyRoom) -> bool:
    """Whether all free moves [µm, rad] are finite and of a size that a scene can have."""
    good = bool(True)
    for b in range(bodies):
        good = good and finite(body.linear[b]) and finite(body.angular[b])
    return good


def find_contacts_term(f: Features) -> wp.Function:
    """`find` of `Stages`.

    A gap is a contact if the free moves of its bodies may close it, others pushing as far as the farthest of them, or
    if its path may touch in between.
    """
    pair_contacts = pair_contacts_term(f) if f.pairs else None
    obstacle_contacts = obstacle_contacts_term(f) if f.obstacles else None

    @wp.func
    def find_contacts(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ) -> int:  # fmt: skip
        """Number of contacts of all bodies with obstacles and with each other, listed in `room`."""
        position = body.position
        rotation = body.rotation
        linear = body.linear
        angular = body.angular
        bodies = int(wp.static(f.bodies))
        count = int(0)
        farthest = float(0.0)
        if wp.static(f.brownian):
            wander = wp.zeros(shape=(wp.static(f.bodies),), dtype=float)
        for a in range(bodies):
            farthest = wp.max(farthest, free_travel(model, a, Move(linear[a], angular[a])))
            if wp.static(f.brownian):
                wander[a] = wander_of(model, world, a)
        for a in range(bodies):
            pose_a = Pose(position[a], rotation[a])
            move_a = Move(linear[a], angular[a])
            pushed = wp.min(farthest, PUSHED * model.body.bound[a])
            if wp.static(bool(f.obstacles)):
                near = pushed
                if wp.static(f.brownian):
                    near = wp.max(near, thermal_reach(wander[a]))
                count = obstacle_contacts(
                    model, readout, world, a, pose_a, move_a, near, room.contacts, count, step, time
                )
            if wp.static(f.pairs):
                for b in range(a):
                    pose_b = Pose(position[b], rotation[b])
                    if wp.static(f.periodic):
                        pose_b.position += image_shift(model.period, pose_b.position - pose_a.position)
                    move_b = Move(linear[b], angular[b])
                    near = pushed
                    if wp.static(f.brownian):
                        near = wp.max(near, thermal_reach(wander[a] + wander[b]))
                    count = pair_contacts(
                        model, readout, world, a, b, pose_a, pose_b, move_a, move_b, near, room.contacts, count, step
                    )  # fmt: skip
        return count

    return find_contacts


def settle_term(f: Features) -> wp.Function:
    """`settle` of `Stages`, for bodies that move by their own contacts alone."""
    fill_base = fill_base_term(f) if f.body_space else None
    solve_bodies = solve_bodies_term(f) if f.body_space else None

    @wp.func
    def settle(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        count: int, again: bool, step: wp.int64,
    ):  # fmt: skip
        """Solve the contacts and add their moves [µm, rad]; a fault where the solution errs by over `UNSETTLED`.

        `again`: they were solved before in this step.
        """
        if count == 0:
            return
        # a free move without bound is the fault that `all_good` reports
        sane = bounded(int(wp.static(f.bodies)), body)
        error = float(0.0)
        if wp.static(f.body_space):
            if not again:
                fill_base(model, world, body.rotation, room.space)
            error = solve_bodies(
                model, room.contacts, count, body.position, again, body.linear, body.angular, room.space
            )
        else:
            error = solve_contacts(
                room.contacts, count, body.linear, body.angular, room.solve.matrix, room.solve.gap,
                room.solve.right, room.solve.pivot, room.solve.order, room.solve.on,
            )  # fmt: skip
        if error > UNSETTLED * room.contacts[0].radius and sane:
            raise_fault(readout, world, room.contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)

    return settle


@wp.func
def report_contacts(readout: ReadoutData, world: int, bodies: int, contacts: wp.array(dtype=Contact), count: int):
    """Write net contact force and sum of |normal forces| [pN] of every body from the solved contacts."""
    for b in range(bodies):
        force = wp.vec3(0.0)
        load = float(0.0)
        for i in range(count):
            c = contacts[i]
            if c.a == b:
                force += c.load * c.normal
                load += wp.abs(c.load)
            if c.b == b:
                force -= c.load * c.normal
                load += wp.abs(c.load)
        readout.contact_force[world, b] = force
        readout.contact_load[world, b] = load
