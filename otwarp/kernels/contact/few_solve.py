"""The contact forces of a world with few contacts: one unknown each, its force.

The energy and the steps are those of `body_solve`. All moves are by contact forces, x = M dt Jᵀμ, so that with
G = J M dt Jᵀ, how far gap i opens per unit of force j, Newton's step is

    (1 + k G) Δμ = λ(s⁰ + G μ) − μ,  k_i = −dλ_i/ds_i.

A few such rows are less work than a matrix of all moves, and a lone contact needs none.
"""

import warp as wp

from otwarp.kernels.contact.body_solve import BALANCED, ROUNDS, WHOLE_ROUNDS, line_at
from otwarp.kernels.contact.contact import along
from otwarp.kernels.contact.contact_list import ContactList, face_term, law_of, load_at, opened_by
from otwarp.kernels.contact.response import response_term
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.types import ModelData, Move, Pose

FEW = wp.constant(4)
"""Contacts up to which a CPU solves them so."""


@wp.struct
class FewRoom:
    """(contacts) what it takes to solve them; the matrices are (contacts²), row by row."""

    reply_a: wp.array(dtype=Move)  # what a unit force moves body a [µm/pN, 1/pN]
    reply_b: wp.array(dtype=Move)
    give: wp.array(dtype=float)  # G [µm/pN]
    system: wp.array(dtype=float)  # 1 + k G, and its factors
    force: wp.array(dtype=float)  # μ [pN]
    left: wp.array(dtype=float)  # λ − μ, then Δμ [pN]


def solve_one_term(f: Features) -> wp.Function:
    """`(model, world, listed, rotation, again, linear, angular) -> float`: as `solve_few_term` for a lone contact."""
    response, face = response_term(f), face_term(f)

    @wp.func
    def solve_one(
        model: ModelData, world: int, listed: ContactList, rotation: wp.array(dtype=wp.quat), again: bool,
        linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    ) -> float:  # fmt: skip
        """Find its depth, and add what it moves to the free moves of its bodies [µm, rad]; the error as there."""
        c = face(listed, 0)
        free = opened_by(listed.face[0])
        give = law_of(listed.law[0], listed.path[0]).give
        force = float(0.0)
        if again:
            force = load_at(listed, 0)
        error = float(0.0)
        for round in range(ROUNDS):
            first = round == 0 and not again
            line = line_at(listed, 0, free + give * force, first)
            left = line.load - force
            # also when it is balanced: what rests under a load then lies still to rounding
            force += wp.where(round < WHOLE_ROUNDS, 1.0, 0.5) * left / (1.0 + give * line.slope)
            if not first:
                error = wp.abs(left) * give
                if error <= BALANCED:
                    error = 0.0
                if error == 0.0 or round == ROUNDS - 1:
                    break
        scale = step_over_viscosity(model, world)
        move = response(model, c.a, Pose(wp.vec3(0.0), rotation[c.a]), scale, c.arm_a, force * c.normal)
        linear[c.a] = linear[c.a] + move.linear
        angular[c.a] = angular[c.a] + move.angular
        if c.b >= 0:
            move = response(model, c.b, Pose(wp.vec3(0.0), rotation[c.b]), scale, c.arm_b, -force * c.normal)
            linear[c.b] = linear[c.b] + move.linear
            angular[c.b] = angular[c.b] + move.angular
        return error

    return solve_one


def reply_term(f: Features, most: int) -> wp.Function:
    """`(model, world, listed, count, rotation, room)`: what forces move bodies, and how that opens gaps."""
    response, face = response_term(f), face_term(f)

    @wp.func
    def reply(
        model: ModelData, world: int, listed: ContactList, count: int, rotation: wp.array(dtype=wp.quat), room: FewRoom
    ):
        """Write the replies to unit forces in `room`, and G."""
        scale = step_over_viscosity(model, world)
        for i in range(count):
            c = face(listed, i)
            pose = Pose(wp.vec3(0.0), rotation[c.a])
            room.reply_a[i] = response(model, c.a, pose, scale, c.arm_a, c.normal)
            if c.b >= 0:
                pose = Pose(wp.vec3(0.0), rotation[c.b])
                room.reply_b[i] = response(model, c.b, pose, scale, c.arm_b, -c.normal)
            room.give[i * most + i] = law_of(listed.law[i], listed.path[i]).give
            for j in range(i):
                pair = listed.pair[j]
                give = float(0.0)
                if pair[0] == c.a:
                    give += along(room.reply_a[j], c.arm_a, c.normal)
                if pair[1] == c.a:
                    give += along(room.reply_b[j], c.arm_a, c.normal)
                if c.b >= 0:
                    if pair[0] == c.b:
                        give -= along(room.reply_a[j], c.arm_b, c.normal)
                    if pair[1] == c.b:
                        give -= along(room.reply_b[j], c.arm_b, c.normal)
                room.give[i * most + j] = give
                room.give[j * most + i] = give

    return reply


def balance_term(most: int) -> wp.Function:
    """`(listed, count, first, room) -> float`: how far forces are from their laws, and the system that mends it."""

    @wp.func
    def look(listed: ContactList, count: int, first: bool, room: FewRoom) -> float:
        """How far a force out of balance would open its gap [µm], at most; fill in `system` and `left`."""
        error = float(0.0)
        for i in range(count):
            opening = opened_by(listed.face[i])
            for j in range(count):
                opening += room.give[i * most + j] * room.force[j]
            line = line_at(listed, i, opening, first)
            for j in range(count):
                room.system[i * most + j] = line.slope * room.give[i * most + j]
            room.system[i * most + i] = 1.0 + room.system[i * most + i]
            room.left[i] = line.load - room.force[i]
            error = wp.max(error, wp.abs(room.left[i]) * room.give[i * most + i])
        return error

    return look


def eliminate_term(most: int) -> wp.Function:
    """`(count, room)`: solve the system for what is left."""

    @wp.func
    def eliminate(count: int, room: FewRoom):
        """Solve `system` for `left`, in place: rows of a positive definite matrix need no exchange."""
        for i in range(count):
            for j in range(i):
                share = room.system[i * most + j] / room.system[j * most + j]
                for k in range(j + 1, count):
                    room.system[i * most + k] = room.system[i * most + k] - share * room.system[j * most + k]
                room.left[i] = room.left[i] - share * room.left[j]
        for back in range(count):
            i = count - 1 - back
            value = room.left[i]
            for k in range(i + 1, count):
                value -= room.system[i * most + k] * room.left[k]
            room.left[i] = value / room.system[i * most + i]

    return eliminate


def solve_few_term(f: Features, most: int) -> wp.Function:
    """`(model, world, listed, count, rotation, again, linear, angular) -> float`: solve at most `most` contacts.

    The gaps are those that `open_gaps_term` wrote.
    """
    reply, solve_one = reply_term(f, most), solve_one_term(f)
    look, eliminate = balance_term(most), eliminate_term(most)

    @wp.func
    def solve_few(
        model: ModelData, world: int, listed: ContactList, count: int, rotation: wp.array(dtype=wp.quat), again: bool,
        linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    ) -> float:  # fmt: skip
        """Find the depths of all contacts, and add what they move to the free moves of the bodies [µm, rad].

        `again`: start from an earlier solution of this step. Returns how far a force out of balance would open its
        gap [µm]: 0 unless the rounds ran out.
        """
        if count == 1:
            return solve_one(model, world, listed, rotation, again, linear, angular)
        reply_a = wp.zeros(shape=(wp.static(most),), dtype=Move)
        reply_b = wp.zeros(shape=(wp.static(most),), dtype=Move)
        give = wp.zeros(shape=(wp.static(most * most),), dtype=float)
        system = wp.zeros(shape=(wp.static(most * most),), dtype=float)
        force = wp.zeros(shape=(wp.static(most),), dtype=float)
        left = wp.zeros(shape=(wp.static(most),), dtype=float)
        room = FewRoom(reply_a, reply_b, give, system, force, left)
        reply(model, world, listed, count, rotation, room)
        if again:
            for i in range(count):
                force[i] = load_at(listed, i)
        error = float(0.0)
        for round in range(ROUNDS):
            first = round == 0 and not again
            error = look(listed, count, first, room)
            if not first:
                if error <= BALANCED:
                    error = 0.0
                if error == 0.0 or round == ROUNDS - 1:
                    break
            eliminate(count, room)
            share = wp.where(round < WHOLE_ROUNDS, 1.0, 0.5)
            for i in range(count):
                force[i] = force[i] + share * left[i]
        for i in range(count):
            pair = listed.pair[i]
            a = pair[0]
            b = pair[1]
            linear[a] = linear[a] + force[i] * reply_a[i].linear
            angular[a] = angular[a] + force[i] * reply_a[i].angular
            if b >= 0:
                linear[b] = linear[b] + force[i] * reply_b[i].linear
                angular[b] = angular[b] + force[i] * reply_b[i].angular
        return error

    return solve_few
