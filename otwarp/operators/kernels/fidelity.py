"""How true the force on the hand of a SIMULATED operator is: against what a twin without error or delay would give.

The other force is that of chains like the operator's, moved by the same hand, which get the state as it is with every
servo period. Sums over the periods of a trial, one thread per hand, in float64.
"""

import warp as wp


@wp.struct
class FidelityData:
    """Sums over servo periods, (W, H) each; e = f − g, f the force on the hand and g the other one [N]."""

    counted: wp.array2d(dtype=wp.int32)  # periods
    error: wp.array2d(dtype=wp.float64)  # Σ |e|² [N²]
    square: wp.array2d(dtype=wp.float64)  # Σ |g|² [N²]
    total: wp.array2d(dtype=wp.vec3d)  # Σ g [N]
    angle: wp.array2d(dtype=wp.float64)  # Σ angle between f and g [rad], where g is large enough to have a direction
    directed: wp.array2d(dtype=wp.int32)  # periods where it is
    warned: wp.array2d(dtype=wp.int32)  # periods in which g warns
    unwarned: wp.array2d(dtype=wp.int32)  # of these, in which f does not: missed warnings
    alarmed: wp.array2d(dtype=wp.int32)  # periods in which f warns and g does not: false warnings


@wp.func
def angle_between(f: wp.vec3d, g: wp.vec3d) -> wp.float64:
    """Angle between two forces [rad], exact for small ones too; a right one where either is none [N]."""
    if wp.length_sq(f) == wp.float64(0.0) or wp.length_sq(g) == wp.float64(0.0):
        return wp.float64(wp.HALF_PI)
    return wp.atan2(wp.length(wp.cross(f, g)), wp.dot(f, g))


@wp.kernel(enable_backward=False)
def compare(
    force: wp.array2d(dtype=wp.vec3d), reference: wp.array2d(dtype=wp.vec3d), gain: wp.array2d(dtype=wp.float64),
    tick: wp.array(dtype=wp.int32), warning: wp.float64, directed: wp.float64, sums: FidelityData,
):  # fmt: skip
    """Add a servo period, over (worlds, hands); a world whose operator's `tick` stands has had none.

    `warning` and `directed` are forces at the specimen [pN]: of which a hand is warned, and from which on a direction
    counts.
    """
    w, h = wp.tid()
    if sums.counted[w, h] == tick[w]:
        return
    sums.counted[w, h] = tick[w]
    f, g = force[w, h], reference[w, h]
    size = wp.length(g)
    sums.error[w, h] = sums.error[w, h] + wp.length_sq(f - g)
    sums.square[w, h] = sums.square[w, h] + size * size
    sums.total[w, h] = sums.total[w, h] + g
    if gain[w, h] <= wp.float64(0.0):
        return
    if size > directed * gain[w, h]:
        sums.angle[w, h] = sums.angle[w, h] + angle_between(f, g)
        sums.directed[w, h] = sums.directed[w, h] + 1
    loud, warns = wp.length(f) > warning * gain[w, h], size > warning * gain[w, h]
    if warns:
        sums.warned[w, h] = sums.warned[w, h] + 1
        if not loud:
            sums.unwarned[w, h] = sums.unwarned[w, h] + 1
    elif loud:
        sums.alarmed[w, h] = sums.alarmed[w, h] + 1
