"""How far the moves of a stage open the gaps of contacts before contact forces are known: s⁰ of `body_solve`.

In the first stage it is found out with the contact, in the second for the whole list.
"""

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part
from otwarp.kernels.contact.body_solve import settling_team
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, face_term, keep_opening, load_at, wander_at
from otwarp.kernels.contact.travel import lift_of, opening_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Move, vec6


@wp.func
def beyond(free: vec6, drift: vec6) -> Move:
    """The free move without its drift [µm, rad]."""
    apart = free - drift
    return Move(linear_part(apart), angular_part(apart))


def first_opening_term(f: Features) -> wp.Function:
    """`(c, opening, free, drift) -> float`: the opening by the free moves, lifted by what noise is in them."""

    @wp.func
    def first_opening(
        c: Contact, opening: float, free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6)
    ) -> float:  # fmt: skip
        """How far the gap of a contact opens in the first stage [µm]; `opening` [µm]: along its normal."""
        total = opening
        if wp.static(f.body_space and f.bends and f.brownian):
            if c.wander > 0.0:
                other = wp.max(c.b, 0)
                total += lift_of(c, beyond(free[c.a], drift[c.a]), beyond(free[other], drift[other]))
        return total

    return first_opening


def open_gaps_term(f: Features) -> wp.Function:
    """`(listed, count, linear, angular, free, drift)`: how far gaps open in the second stage."""
    face, team = face_term(f), settling_team(f)
    size_of, lane_of = team.size, team.lane

    @wp.func
    def open_gaps(
        listed: ContactList, count: int, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
        free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6),
    ):  # fmt: skip
        """Write the openings by the moves `linear` and `angular` [µm, rad] of the stage.

        Those of contacts that push, or whose path may, are lifted by the whole moves `free` − `drift`.
        """
        i = lane_of()
        ahead = face(listed, wp.min(i, count - 1))
        wander_ahead = wander_at(listed, wp.min(i, count - 1))
        while i < count:
            a = ahead.a
            b = ahead.b
            other = wp.max(b, 0)
            move_a = Move(linear[a], angular[a])
            move_b = Move(linear[other], angular[other])
            lift_a = Move()
            lift_b = Move()
            if wp.static(f.bends):
                lift_a = beyond(free[a], drift[a])
                lift_b = beyond(free[other], drift[other])
            # neighbours in the list are contacts of the same bodies, whose moves are read once
            joined = bool(True)
            while joined:
                c = ahead
                wander = wander_ahead
                # read before this one is worked out: the memory of a GPU is far away
                ahead = face(listed, wp.min(i + size_of(), count - 1))
                if wp.static(f.bends):
                    wander_ahead = wander_at(listed, wp.min(i + size_of(), count - 1))
                opening = opening_of(c, move_a, move_b)
                if wp.static(f.bends):
                    if wander > 0.0 or load_at(listed, i) != 0.0:
                        opening += lift_of(c, lift_a, lift_b)
                keep_opening(listed, i, c.normal, opening)
                i += size_of()
                joined = i < count and ahead.a == a and ahead.b == b

    return open_gaps
