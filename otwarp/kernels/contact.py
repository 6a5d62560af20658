"""Contact: the force law of two elastic adhesive spheres, and how far bodies give way to a contact force.

Force law: Hertz repulsion with Derjaguin–Muller–Toporov adhesion (Derjaguin, Muller, Toporov 1975,
doi:10.1016/0021-9797(75)90018-1). All contacts are linearised about the start of the step and solved together for the
contact forces λ, by `solve` in the world driver and by `grid_contacts` in the grid driver, so that a stiff contact does
not limit the time step. Every λ acts on both bodies with opposite sign.
"""

import warp as wp

from otwarp.kernels.types import BodyData, ContactData, Move, mat66, vec6

SETTLED = 1.0e-6
"""Error of a gap below which a contact counts as solved [µm]: rounding of float32 coordinates."""

UNSETTLED = wp.constant(0.01)
"""Error of a gap, relative to the effective radius, above which an unfinished solution stops the run."""

_PI = wp.constant(3.141592653589793)


@wp.struct
class Contact:
    """One contact between body `a` and body `b` (-1: an obstacle); `normal` points from b to a."""

    a: int
    b: int
    normal: wp.vec3
    arm_a: wp.vec3
    """Centre of the touching sphere of a, from the reference point of a [µm], world axes; `arm_b` likewise.

    The normal runs through both centres, so a force there has the torque of one at the contact point.
    """
    arm_b: wp.vec3
    radius: float
    """Effective radius [µm]."""
    force: float
    """Force at the start of the step [pN], positive when it repels."""
    floor: float
    """Least force the contact can carry [pN]: minus the pull-off force, 0 without adhesion."""
    stiffness: float
    """−dF/dgap at the start of the step [pN/µm]."""
    drift: float
    """Displacement of a moving obstacle along the normal during the step [µm]."""
    response_a: Move
    """Displacement of a per unit contact force [µm/pN]; `response_b` that of b for the reaction."""
    response_b: Move
    give: float
    """Opening of the gap per unit contact force [µm/pN]."""
    load: float
    """Solution λ: mean force during the step [pN]."""


@wp.struct
class PairForce:
    """Repulsion minus adhesion [pN], stiffness [pN/µm] and the least force [pN]."""

    force: float
    stiffness: float
    floor: float


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
    pull = 2.0 * _PI * radius * adhesion
    result = PairForce(0.0, 0.0, -pull)
    if overlap > 0.0:
        root = wp.sqrt(radius * overlap)
        result.force = 4.0 / 3.0 * root * overlap / compliance - pull
        result.stiffness = 2.0 * root / compliance
    elif overlap > -reach:
        result.force = -pull * (1.0 + overlap / reach)
    return result


@wp.func
def pair_law(contact: ContactData, a: int, b: int, radius: float, overlap: float) -> PairForce:
    """Force law between the surfaces of bodies a and b (b = -1: a rigid, inert obstacle)."""
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
def sphere_response(body: BodyData, b: int, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
    """Displacement of a lone sphere by `force` acting for one step; `scale` = dt/η."""
    return Move((scale * body.translation[body.shape[b]]) * force, wp.vec3(0.0))


@wp.func
def rigid_response(body: BodyData, b: int, q: wp.quat, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
    """Displacement and rotation of a rigid body by `force` at `arm` acting for one step; `scale` = dt/η."""
    f = wp.quat_rotate_inv(q, force)
    t = wp.quat_rotate_inv(q, wp.cross(arm, force))
    v = scale * (body.mobility[body.shape[b]] * vec6(f[0], f[1], f[2], t[0], t[1], t[2]))
    return Move(
        wp.quat_rotate(q, wp.vec3(v[0], v[1], v[2])),
        wp.quat_rotate(q, wp.vec3(v[3], v[4], v[5])),
    )


@wp.func
def along(move: Move, arm: wp.vec3, normal: wp.vec3) -> float:
    """Displacement along `normal` of the point at `arm` of a body that moves by `move`."""
    return wp.dot(move.linear + wp.cross(move.angular, arm), normal)


NO_CONTACT = wp.constant(-1)
"""Index of the other body when the partner is an obstacle."""

__all__ = [
    "NO_CONTACT",
    "SETTLED",
    "UNSETTLED",
    "Contact",
    "along",
    "hertz_dmt",
    "mat66",
    "pair_law",
    "pair_reach",
    "rigid_response",
    "sphere_response",
]
