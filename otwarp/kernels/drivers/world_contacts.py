"""Contacts of a world of few bodies: found once a step, solved in each stage, and reported."""

import warp as wp

from otwarp.kernels.contact.body_solve import open_gaps_term, solve_bodies_term
from otwarp.kernels.contact.contact import UNSETTLED
from otwarp.kernels.contact.contact_list import ContactList, solved_term
from otwarp.kernels.contact.detect import obstacle_contacts_term, pair_contacts_term
from otwarp.kernels.contact.solve import lift_gaps, solve_contacts
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
                    model, readout, world, a, pose_a, move_a, near, room.listed, count, step, time
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
                        model, readout, world, a, b, pose_a, pose_b, move_a, move_b, near, room.listed, count, step
                    )  # fmt: skip
        return count

    return find_contacts


def settle_term(f: Features) -> wp.Function:
    """`settle` of `Stages`, for bodies that move by their own contacts alone."""
    return settle_moves_term(f) if f.body_space else settle_forces_term(f)


def settle_moves_term(f: Features) -> wp.Function:
    """`settle` of `Stages` where contacts are solved for what they move."""
    open_gaps = open_gaps_term(f)
    solve_bodies = solve_bodies_term(f)

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
        listed = room.listed
        open_gaps(listed, count, again, body.linear, body.angular, body.free, body.drift)
        error = solve_bodies(
            model, world, listed, count, body.position, body.rotation, again, body.linear, body.angular, room.space
        )
        if error > UNSETTLED * listed.arm_a[0][3] and sane:
            raise_fault(readout, world, listed.pair[0][0], wp.static(int(Fault.UNSETTLED)), step)

    return settle


def settle_forces_term(f: Features) -> wp.Function:
    """`settle` of `Stages` where contacts are solved for their forces."""

    @wp.func
    def settle(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        count: int, again: bool, step: wp.int64,
    ):  # fmt: skip
        """Solve the contacts and add their moves [µm, rad]; a fault where the solution errs by over `UNSETTLED`."""
        if count == 0:
            return
        contacts = room.listed.whole
        sane = bounded(int(wp.static(f.bodies)), body)
        if wp.static(f.bends):
            if wp.static(f.brownian) or again:
                lift_gaps(contacts, count, body.free, body.drift)
        error = solve_contacts(
            contacts, count, body.linear, body.angular, room.solve.matrix, room.solve.gap,
            room.solve.right, room.solve.pivot, room.solve.order, room.solve.on,
        )  # fmt: skip
        if error > UNSETTLED * contacts[0].radius and sane:
            raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)

    return settle


def report_contacts_term(f: Features) -> wp.Function:
    """`(readout, world, listed, count)`: write what the solved contacts do to each body."""
    solved = solved_term(f)

    @wp.func
    def report_contacts(readout: ReadoutData, world: int, listed: ContactList, count: int):
        """Net contact force and sum of |normal forces| [pN] of every body."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            force = wp.vec3(0.0)
            load = float(0.0)
            for i in range(count):
                c = solved(listed, i)
                if c.a == b:
                    force += c.load * c.normal
                    load += wp.abs(c.load)
                if c.b == b:
                    force -= c.load * c.normal
                    load += wp.abs(c.load)
            readout.contact_force[world, b] = force
            readout.contact_load[world, b] = load

    return report_contacts
