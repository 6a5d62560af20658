"""Contact: the force law of two elastic adhesive spheres, and how far bodies give way to a contact force.

Force law: Hertz repulsion with Derjaguin–Muller–Toporov adhesion (Derjaguin, Muller, Toporov 1975,
doi:10.1016/0021-9797(75)90018-1). Bodies touch by their elements: spheres, and rods, which are segments with a radius.
A rod touches like a sphere of its radius about the nearest point of its axis. This is exact at its ends; where the
sides of two equal rods cross at right angles the repulsion is 2^(−1/2) of Hertz's and the pull-off force half of it,
and the force does not jump when a contact moves from an end to the side (K. L. Johnson, Contact Mechanics, 1985, §4.1).

During a step the force follows F(δ) = floor + K·δ^{3/2} (no Hertz part for δ < 0); contacts that are not yet closed are
listed too, so that a gap may close in a step but not be crossed. All contacts of a world are solved together for the
contact forces λ, by `solve` in the world driver and by `drivers.grid.contacts` in the grid driver, so that a stiff
contact does not limit the time step. Every λ acts on both bodies with opposite sign.
"""

import warp as wp

from otwarp.kernels.core.reads import mat66_at
from otwarp.kernels.core.roots import square_root
from otwarp.kernels.core.rounding import PI
from otwarp.kernels.core.types import BodyData, ContactData, Move, mat66, vec6

SETTLED = 1.0e-6
"""Error of a gap below which a contact counts as solved [µm]: rounding of float32 coordinates."""

UNSETTLED = wp.constant(0.01)
"""Error of a gap, relative to the effective radius, above which an unfinished solution stops the run."""

FIRST_OVERLAP = wp.constant(0.01)
"""Overlap, relative to the effective radius, whose stiffness a gap gets that nothing but other contacts may close."""

HARDEST = wp.constant(1.0e3)
"""Largest κ = 1.5·K·√δ·give, at an overlap of `FIRST_OVERLAP`, with which contacts are solved for what they move.

A contact that is stiffer counts as so stiff: from 10⁴ on float32 has too few digits for the loads. The error is at most
its overlap, where its load keeps out x in a step δ = (0.15·x·√R/κ)^{2/3}: 6·10⁻⁴ µm at x = 0.1 µm and R = 1 µm."""


@wp.struct
class Contact:
    """One contact between body `a` and body `b` (-1: an obstacle); `normal` points from b to a."""

    a: int
    b: int
    normal: wp.vec3
    arm_a: wp.vec3
    """Centre of the touching sphere of a, or nearest point of the axis of its rod, from the reference point of a [µm],
    world axes; `arm_b` likewise.

    The normal runs through both, so a force there has the torque of one at the contact point.
    """
    arm_b: wp.vec3
    radius: float
    """Effective radius [µm]."""
    overlap: float
    """δ at the start of the step [µm], negative for a gap."""
    hardness: float
    """K = 4/3·E*·√R [pN/µm^{3/2}]."""
    force: float
    """Force at the start of the step [pN], positive when it repels: where the line that stands for F(δ) has it."""
    floor: float
    """Least force the contact can carry [pN]: minus the pull-off force; what a gap feels when it is not yet closed."""
    stiffness: float
    """Slope of that line, −dF/dgap [pN/µm]; until the contacts are solved together the one at the start."""
    drift: wp.vec3
    """Displacement of a moving obstacle during the step [µm]: of its centre of curvature, or of the point touched."""
    curvature: float
    """One over the distance of the touching elements' centres of curvature where they touch [1/µm], 0 if flat."""
    ridge: wp.vec3
    """Unit vector across the normal along which they are flat, 0 if they are curved both ways."""
    lift: float
    """Opening of the gap by motion across the normal [µm], see `travel.lift_of`; that of the solution before."""
    response_a: Move
    """Displacement of a per unit contact force [µm/pN]; `response_b` that of b for the reaction."""
    response_b: Move
    give: float
    """Opening of the gap per unit contact force [µm/pN]."""
    wander: float
    """W = −2 s² ln U of this step's thermal excursion [µm²], see `excursion`; 0 without one."""
    layer: float
    """Depth of it that the elastic contact resolves by itself [µm]."""
    load: float
    """Solution λ: mean force during the step [pN]."""


@wp.struct
class PairForce:
    """Repulsion minus adhesion [pN], stiffness [pN/µm], least force [pN] and hardness [pN/µm^{3/2}]."""

    force: float
    stiffness: float
    floor: float
    hardness: float


@wp.func
def hertz_dmt(overlap: float, radius: float, compliance: float, adhesion: float, reach: float) -> PairForce:
    """F = 4/3·E*·√R·δ^{3/2} − 2πRW for δ > 0, and −2πRW·(1 + δ/reach) for −reach < δ ≤ 0.

    Args:
        overlap: δ [µm].
        radius: effective radius R [µm].
        compliance: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂ [µm²/pN].
        adhesion: work of adhesion W [pN/µm].
        reach: gap over which the adhesion fades [µm].
    """
    pull = 2.0 * PI * radius * adhesion
    hardness = 4.0 / 3.0 * square_root(radius) / compliance
    result = PairForce(0.0, 0.0, -pull, hardness)
    if overlap > 0.0:
        root = square_root(overlap)
        result.force = hardness * root * overlap - pull
        result.stiffness = 1.5 * hardness * root
    elif overlap > -reach:
        result.force = -pull * (1.0 + overlap / reach)
    return result


@wp.func
def pair_law(contact: ContactData, a: int, b: int, radius: float, overlap: float) -> PairForce:
    """Force law [pN, pN/µm] of bodies a and b at `overlap` [µm]; b = −1 is a rigid, inert obstacle."""
    compliance = contact.compliance[a]
    adhesion = contact.adhesion[a]
    reach = contact.adhesion_range[a]
    if b >= 0:
        compliance = compliance + contact.compliance[b]
        if contact.adhesion[b] > adhesion:
            adhesion = contact.adhesion[b]
            reach = contact.adhesion_range[b]
        elif contact.adhesion[b] == adhesion:
            reach = wp.max(reach, contact.adhesion_range[b])
    return hertz_dmt(overlap, radius, compliance, adhesion, reach)


@wp.func
def pair_reach(contact: ContactData, a: int, b: int) -> float:
    """Gap up to which bodies a and b feel each other [µm]: the range of their adhesion, 0 without."""
    reach = wp.where(contact.adhesion[a] > 0.0, contact.adhesion_range[a], 0.0)
    if b >= 0 and contact.adhesion[b] > 0.0:
        reach = wp.max(reach, contact.adhesion_range[b])
    return reach


@wp.func
def overlap_alone(hardness: float, give: float, reach: float) -> float:
    """Overlap δ ≥ 0 at which a lone contact ends a step that would take it to `reach` > 0 without repulsion [µm].

    δ + give·K·δ^{3/2} = reach, backward Euler for Hertz's law. As w² + A·w³ = reach in w = √δ, convex: Newton's steps
    from above, no further than a factor of two from the root, come down on it without crossing it.
    """
    a = give * hardness
    w = square_root(reach)
    if a > 0.0:
        w = wp.min(w, wp.pow(reach / a, 1.0 / 3.0))
    for _ in range(5):
        w = nearer_root(w, a, reach)
    return w * w


@wp.func
def nearer_root(w: float, a: float, reach: float) -> float:
    """One of Newton's steps to w² + a·w³ = reach."""
    return w - (w * w + a * w * w * w - reach) / (2.0 * w + 3.0 * a * w * w)


@wp.func
def anticipate(c: Contact, opening: float) -> Contact:
    """The contact with the line that stands for F(δ) during a step whose free moves open its gap by `opening` [µm].

    A closing contact gets the chord from its start to where it would end if it were alone, so that alone it is solved
    exactly; a parting one the tangent at its start. Both keep the force of a contact that does not move. A gap feels
    nothing but the adhesion it starts with until it is closed. Whatever line the contact had before does not count.
    """
    if c.hardness > 0.0:
        reach = c.overlap - opening - c.give * c.floor
        start = square_root(wp.max(c.overlap, 0.0))
        end = float(0.0)
        if reach > wp.max(c.overlap, 0.0) + c.give * c.hardness * start * start * start:
            end = square_root(overlap_alone(c.hardness, c.give, reach))
        if c.overlap > 0.0:
            end = wp.max(end, start)
            c.force = c.floor + c.hardness * start * start * start
            c.stiffness = c.hardness * (end * end + end * start + start * start) / (end + start)
        else:
            if end == 0.0:
                end = square_root(FIRST_OVERLAP * c.radius)
            c.stiffness = c.hardness * end
            c.force = c.floor + c.stiffness * c.overlap
    return c


@wp.func
def law_error(c: Contact, overlap: float, enough: float) -> float:
    """How far from F(δ) the load of a contact that ends at `overlap` is, as an error of its gap [µm]; 0 up to `enough`.

    The lesser of what the missing force would move, and of how far the overlap is from that of the load: for a stiff
    contact the first is rounding of coordinates times its stiffness, for a soft one the second means little.
    """
    error = float(0.0)
    if c.hardness > 0.0:
        root = square_root(wp.max(overlap, 0.0))
        excess = wp.max(c.load - c.floor, 0.0)
        missing = wp.abs(c.hardness * root * root * root - excess) * c.give
        error = missing / (1.0 + 1.5 * c.hardness * root * c.give)
        if error > enough:
            apart = wp.max(overlap, 0.0)
            if excess > 0.0:
                apart = wp.abs(overlap - wp.pow(excess / c.hardness, 2.0 / 3.0))
            error = wp.min(error, apart)
    return wp.where(error > enough, error, 0.0)


@wp.func
def tangent_at(c: Contact, overlap: float) -> Contact:
    """The contact with the tangent to F(δ) at `overlap` [µm] in place of its line (Newton's step)."""
    root = square_root(wp.max(overlap, 0.0))
    if root > 0.0:
        c.stiffness = 1.5 * c.hardness * root
        c.force = c.floor + c.hardness * root * root * root + c.stiffness * (c.overlap - overlap)
    return c


@wp.func
def hardest(radius: float, give: float) -> float:
    """Hardness K [pN/µm^{3/2}] of a contact of κ = `HARDEST`: of effective radius [µm] and give [µm/pN]."""
    return HARDEST / (1.5 * square_root(FIRST_OVERLAP * radius) * give)


@wp.func
def sphere_response(body: BodyData, b: int, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
    """Displacement [µm] of a lone sphere by `force` [pN] acting for one step; `scale` = dt/η [µm²/pN]."""
    return Move((scale * body.translation[body.shape[b]]) * force, wp.vec3(0.0))


@wp.func
def rigid_response(body: BodyData, b: int, q: wp.quat, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
    """Move [µm, rad] of a rigid body by `force` [pN] at `arm` [µm] acting for one step; `scale` = dt/η [µm²/pN]."""
    f = wp.quat_rotate_inv(q, force)
    t = wp.quat_rotate_inv(q, wp.cross(arm, force))
    v = scale * (mat66_at(body.mobility, body.shape[b]) * vec6(f[0], f[1], f[2], t[0], t[1], t[2]))
    return Move(
        wp.quat_rotate(q, wp.vec3(v[0], v[1], v[2])),
        wp.quat_rotate(q, wp.vec3(v[3], v[4], v[5])),
    )


@wp.func
def along(move: Move, arm: wp.vec3, normal: wp.vec3) -> float:
    """Displacement [µm] along `normal` of the point at `arm` [µm] of a body that moves by `move`."""
    return wp.dot(move.linear + wp.cross(move.angular, arm), normal)


NO_CONTACT = wp.constant(-1)
"""Index of the other body when the partner is an obstacle."""

__all__ = [
    "NO_CONTACT",
    "SETTLED",
    "UNSETTLED",
    "Contact",
    "along",
    "anticipate",
    "hardest",
    "hertz_dmt",
    "law_error",
    "mat66",
    "nearer_root",
    "overlap_alone",
    "pair_law",
    "pair_reach",
    "rigid_response",
    "sphere_response",
    "tangent_at",
]
