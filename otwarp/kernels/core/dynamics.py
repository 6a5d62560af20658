"""How one kind of body drifts, diffuses and moves: what an integrator is composed from.

Positions of spheres are vectors; rigid bodies move by twists (displacement and rotation vector in world axes), which
the exponential map applies. About the centre of diffusion neither needs a drift correction for a mobility that turns
with the body (Brenner 1967, J. Colloid Interface Sci. 23, 407).
"""

from dataclasses import dataclass

import warp as wp


@dataclass(frozen=True)
class Dynamics:
    """How one kind of body drifts, diffuses and moves; what an integrator is composed from.

    Attributes:
        pose, move, constants, stiffness_type: Warp types of the functions below.
        drift: `(model, control, state, constants, world, b, pose, time) -> move`, a·dt.
        noise: `(model, constants, world, b, pose, step) -> move`, σ ΔW of that step.
        shifted: `(pose, move) -> pose`.
        pulled_back: `(move, drift) -> drift` found after `move`, as it counts at the start of the move.
        stiffness: `(model, control, state, constants, world, b, pose, time) -> matrix` K, symmetric part of −∂F/∂x.
        relax: `(constants, pose, stiffness, move) -> move`, Z·v with Z = M K dt.
        early: Whether the second stage of a step looks a moment before its end, because commands may leap there.
        large: Whether the code of `drift` is so large that it should stand only once.
        strayed: `(constants, move) -> constants` with which a second stage looks after `move`, where they hold near the
            start of a step alone.
    """

    pose: type
    move: type
    constants: type
    stiffness_type: type
    drift: wp.Function
    noise: wp.Function
    shifted: wp.Function
    pulled_back: wp.Function
    stiffness: wp.Function | None
    relax: wp.Function | None
    early: bool = False
    large: bool = False
    strayed: wp.Function | None = None
