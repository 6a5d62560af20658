"""Contact: the force law of two elastic adhesive spheres, and the compliant solver that applies it.

Force law: Hertz repulsion with Derjaguin–Muller–Toporov adhesion (Derjaguin, Muller, Toporov 1975,
doi:10.1016/0021-9797(75)90018-1). Solver: all contacts of a world are linearised about the start of the step and
solved together by projected Gauss–Seidel on the contact forces λ, so a stiff contact does not limit the time step.
Every λ acts on both bodies with opposite sign: the third law holds exactly, whatever the number of sweeps.
"""

import warp as wp

from otwarp.kernels.types import BodyData, ContactData, Move, mat66, vec6

SWEEPS = 50
"""Most Gauss–Seidel sweeps over the contacts of a world in one step."""

SETTLED = 1.0e-6
"""Change of a gap in a whole sweep below which the contacts count as solved [µm]: rounding of float32 coordinates."""

_PI = wp.constant(3.141592653589793)


@wp.struct
class Contact:
    """One contact between body `a` and body `b` (-1: an obstacle); `normal` points from b to a."""

    a: int
    b: int
    normal: wp.vec3
    arm_a: wp.vec3
    """Contact point relative to the reference point of a [µm], world axes; `arm_b` likewise."""
    arm_b: wp.vec3
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


@wp.func
def solve_contacts(
    contacts: wp.array(dtype=Contact),
    count: int,
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    sweeps: int,
    settled: float,
):
    """Find the contact forces of one step and add what they move to `linear` and `angular` (per body).

    Each contact obeys λ = max(floor, F − k·s), with s the opening of its gap during the step, itself a result of all
    λ: backward Euler for the linearised contacts. One visit solves one contact with the others held fixed. The first
    guess is F, which is the solution when nothing moves, such as for a body squeezed from two sides; sweeps from zero
    would need the more visits to build such forces up the stiffer they are.
    """
    for i in range(count):
        c = contacts[i]
        contacts[i].load = c.force
        linear[c.a] = linear[c.a] + c.force * c.response_a.linear
        angular[c.a] = angular[c.a] + c.force * c.response_a.angular
        if c.b >= 0:
            linear[c.b] = linear[c.b] + c.force * c.response_b.linear
            angular[c.b] = angular[c.b] + c.force * c.response_b.angular
    for sweep in range(sweeps):
        largest = float(0.0)
        for visit in range(count):
            # forwards and backwards in turn, so that no contact is favoured
            i = wp.where(sweep % 2 == 0, visit, count - 1 - visit)
            c = contacts[i]
            opening = along(Move(linear[c.a], angular[c.a]), c.arm_a, c.normal) - c.drift
            if c.b >= 0:
                opening -= along(Move(linear[c.b], angular[c.b]), c.arm_b, c.normal)
            others = opening - c.give * c.load
            load = wp.max((c.force - c.stiffness * others) / (1.0 + c.stiffness * c.give), c.floor)
            change = load - c.load
            largest = wp.max(largest, wp.abs(change) * c.give)
            contacts[i].load = load
            linear[c.a] = linear[c.a] + change * c.response_a.linear
            angular[c.a] = angular[c.a] + change * c.response_a.angular
            if c.b >= 0:
                linear[c.b] = linear[c.b] + change * c.response_b.linear
                angular[c.b] = angular[c.b] + change * c.response_b.angular
        if largest <= settled:
            break


NO_CONTACT = wp.constant(-1)
"""Index of the other body when the partner is an obstacle."""

__all__ = [
    "NO_CONTACT",
    "SETTLED",
    "SWEEPS",
    "Contact",
    "along",
    "hertz_dmt",
    "mat66",
    "pair_law",
    "pair_reach",
    "rigid_response",
    "solve_contacts",
    "sphere_response",
]
