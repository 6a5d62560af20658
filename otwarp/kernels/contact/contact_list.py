"""The list of a world's contacts: whole records, or field by field where contacts are solved for moves.

Threads of a GPU read field after field of their own worlds next to each other, and a list is as long as a world can
have contacts: fields lie in arrays of all worlds, and what a solver can compute again is not kept.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, curvature_of, point_of
from otwarp.kernels.core.reads import (
    pair_at,
    pitch_of,
    put_pair,
    put_real,
    put_vec2,
    put_vec4,
    real_at,
    vec2_at,
    vec4_at,
)
from otwarp.kernels.core.roots import square_root
from otwarp.kernels.core.team import count_below, team_of
from otwarp.kernels.core.types import ReadoutData

NO_RIDGE = ("plane", "mesh", "sphere")
"""Shapes that are curved both ways or not at all."""


@wp.struct
class ContactList:
    """(contacts) of one world; see `Contact`. Either `whole` has a length, or the others have."""

    whole: wp.array(dtype=Contact)
    pair: wp.array(dtype=wp.vec2i)  # bodies a and b
    face: wp.array(dtype=wp.vec4)  # normal, and how far the moves of this stage open the gap [µm]
    law: wp.array(dtype=wp.vec4)  # overlap, hardness, give, floor
    path: wp.array(dtype=wp.vec2)  # wander, layer
    depth: wp.array(dtype=float)  # δ that carries the load above the floor [µm]
    arm_a: wp.array(dtype=wp.vec4)  # and the effective radius
    arm_b: wp.array(dtype=wp.vec4)  # and the curvature
    ridge: wp.array(dtype=wp.vec3)  # only where elements or obstacles have one; of bodies only where there are rods
    drift: wp.array(dtype=wp.vec3)  # only where obstacles move, and of these contacts alone


def has_ridges(f: Features) -> bool:
    """Whether something that can be touched is flat one way and curved the other."""
    return f.rods or bool(set(f.obstacles) - set(NO_RIDGE))


def unused_fields(f: Features) -> set[str]:
    """Arrays of a `ContactList` that a scene has no use for."""
    if not f.body_space:
        return set(ContactList.vars) - {"whole"}
    return {"whole", *(() if has_ridges(f) else ("ridge",)), *(() if f.moving_obstacles else ("drift",))}


def put_term(f: Features) -> wp.Function:
    """`(readout, world, listed, count, c, opening, step) -> count`: append a contact to a world's list."""

    @wp.func
    def put(
        readout: ReadoutData, world: int, listed: ContactList, count: int, c: Contact, opening: float, step: wp.int64
    ) -> int:
        """The new count; a fault when the list is full. `opening` [µm] as `first_opening_term` has it."""
        if count >= wp.static(f.max_contacts):
            raise_fault(readout, world, c.a, wp.static(int(Fault.OVERFLOW)), step)
            return count
        if wp.static(f.body_space):
            at = count * pitch_of(listed.face)
            put_pair(listed.pair, at, wp.vec2i(c.a, c.b))
            put_vec4(listed.face, at, beside(c.normal, opening))
            put_vec4(listed.law, at, wp.vec4(c.overlap, c.hardness, c.give, c.floor))
            put_vec2(listed.path, at, wp.vec2(c.wander, c.layer))
            put_real(listed.depth, at, 0.0)
            put_vec4(listed.arm_a, at, beside(c.arm_a, c.radius))
            put_vec4(listed.arm_b, at, beside(c.arm_b, c.curvature))
            if wp.static(has_ridges(f)):
                if c.b < 0 or wp.static(f.rods):
                    listed.ridge[count] = c.ridge
            if wp.static(f.moving_obstacles):
                if c.b < 0:
                    listed.drift[count] = c.drift
        else:
            listed.whole[count] = c
        return count + 1

    return put


def counted_term(f: Features) -> wp.Function:
    """`(votes, count) -> count`: a list's length once every thread that has voted has put its contact behind it."""
    size_of = team_of(f).size

    @wp.func
    def counted(votes: int, count: int) -> int:
        """The new count, no more than there is room for."""
        return wp.min(count + count_below(votes, size_of()), wp.static(f.max_contacts))

    return counted


@wp.struct
class Entry:
    """What a `ContactList` says of one contact that solvers read in every round."""

    pair: wp.vec2i
    face: wp.vec4
    law: wp.vec4
    path: wp.vec2
    depth: float


@wp.func
def entry_at(listed: ContactList, i: int) -> Entry:
    """Entry i with the fields and units of `ContactList`, read at once so that loads do not wait for each other."""
    at = i * pitch_of(listed.face)
    return Entry(
        pair_at(listed.pair, at), vec4_at(listed.face, at), vec4_at(listed.law, at), vec2_at(listed.path, at),
        real_at(listed.depth, at),
    )  # fmt: skip


@wp.func
def keep_depth(listed: ContactList, i: int, depth: float):
    """Write the depth [µm] of entry i."""
    put_real(listed.depth, i * pitch_of(listed.face), depth)


@wp.func
def keep_opening(listed: ContactList, i: int, normal: wp.vec3, opening: float):
    """Write how far the moves of a stage open the gap [µm] of entry i, beside its normal."""
    put_vec4(listed.face, i * pitch_of(listed.face), beside(normal, opening))


@wp.func
def wander_at(listed: ContactList, i: int) -> float:
    """Wander [µm²] of entry i, which is 0 where no path may touch."""
    return vec2_at(listed.path, i * pitch_of(listed.face))[0]


@wp.func
def opened_by(face: wp.vec4) -> float:
    """How far the moves of this stage open a gap [µm], with its normal."""
    return face[3]


@wp.func
def law_of(law: wp.vec4, path: wp.vec2) -> Contact:
    """A contact as far as its law of force goes."""
    c = Contact()
    c.overlap = law[0]
    c.hardness = law[1]
    c.give = law[2]
    c.floor = law[3]
    c.wander = path[0]
    c.layer = path[1]
    return c


def face_term(f: Features) -> wp.Function:
    """`(listed, i) -> Contact`: contact i as far as its geometry goes."""

    @wp.func
    def face(listed: ContactList, i: int) -> Contact:
        """Bodies, normal, arms, curvature, ridge and drift."""
        c = Contact()
        at = i * pitch_of(listed.face)
        pair = pair_at(listed.pair, at)
        arm_b = vec4_at(listed.arm_b, at)
        c.a = pair[0]
        c.b = pair[1]
        c.normal = point_of(vec4_at(listed.face, at))
        c.arm_a = point_of(vec4_at(listed.arm_a, at))
        c.arm_b = point_of(arm_b)
        c.curvature = curvature_of(arm_b)
        if wp.static(has_ridges(f)):
            if c.b < 0 or wp.static(f.rods):
                c.ridge = listed.ridge[i]
        if wp.static(f.moving_obstacles):
            if c.b < 0:
                c.drift = listed.drift[i]
        return c

    return face


@wp.func
def load_at(listed: ContactList, i: int) -> float:
    """Load of contact i [pN], from the depth that carries it."""
    at = i * pitch_of(listed.face)
    law = law_of(vec4_at(listed.law, at), wp.vec2())
    depth = real_at(listed.depth, at)
    return law.floor + law.hardness * depth * square_root(depth)


def solved_term(f: Features) -> wp.Function:
    """`(listed, i) -> Contact`: contact i as far as its force goes, once it is solved."""

    @wp.func
    def solved(listed: ContactList, i: int) -> Contact:
        """Contact i with its bodies, its unit normal and its load [pN]; the rest of it is 0 where moves are solved."""
        c = Contact()
        if wp.static(f.body_space):
            pair = listed.pair[i]
            c.a = pair[0]
            c.b = pair[1]
            c.normal = point_of(listed.face[i])
            c.load = load_at(listed, i)
        else:
            c = listed.whole[i]
        return c

    return solved
