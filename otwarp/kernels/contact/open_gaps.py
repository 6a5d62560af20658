"""How far the moves of a stage open the gaps of listed contacts before contact forces are known: s⁰ of `body_solve`."""

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part
from otwarp.kernels.contact.body_solve import settling_team
from otwarp.kernels.contact.contact_list import ContactList, face_term, load_at
from otwarp.kernels.contact.travel import lift_of, opening_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside
from otwarp.kernels.core.reads import put_strided_vec4
from otwarp.kernels.core.types import Move, vec6


def open_gaps_term(f: Features) -> wp.Function:
    """`(listed, count, again, linear, angular, free, drift)`: how far gaps open without contact forces."""
    face, team = face_term(f), settling_team(f)
    size_of, lane_of = team.size, team.lane

    @wp.func
    def beyond(free: vec6, drift: vec6) -> Move:
        """The free move without its drift [µm, rad]."""
        apart = free - drift
        return Move(linear_part(apart), angular_part(apart))

    @wp.func
    def open_gaps(
        listed: ContactList, count: int, again: bool, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
        free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6),
    ):  # fmt: skip
        """Write the openings by the moves `linear` and `angular` [µm, rad], lifted by the moves `free` − `drift`.

        These are the noise in the first stage, and whole moves in the second, where contacts that push are lifted, too.
        """
        i = lane_of()
        ahead = face(listed, wp.min(i, count - 1))
        wander_ahead = listed.path[wp.min(i, count - 1)][0]
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
                    wander_ahead = listed.path[wp.min(i + size_of(), count - 1)][0]
                opening = opening_of(c, move_a, move_b)
                if wp.static(f.bends):
                    lifted = wander > 0.0
                    if again and not lifted:
                        lifted = load_at(listed, i) != 0.0
                    if lifted:
                        opening += lift_of(c, lift_a, lift_b)
                put_strided_vec4(listed.face, i, beside(c.normal, opening))
                i += size_of()
                joined = i < count and ahead.a == a and ahead.b == b

    return open_gaps
