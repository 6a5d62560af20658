"""The force of a contact as a function of how far its gap opens in a step, and the lines that stand for it.

With s the opening of the gap, λ = floor + K·δ^{3/2}, and δ(s) is the larger of Hertz's overlap − s and of what the
path asks for (`excursion`): with b = layer − overlap the root of

    give·K·δ^{3/2} + δ + b = W/4 / (s + δ + b),

whose left side rises and whose right side falls with δ, and which lies below Hertz's where that asks for more. λ falls
with s, so that the forces of any number of contacts together follow from the least of a convex energy, see
`body_solve`.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, Contact
from otwarp.kernels.contact.excursion import PATH_TOLERANCE, kept_reach, meets_path

LAW_TOLERANCE = wp.constant(1.0e-3)
"""Error of a gap, relative to the effective radius, for which a line stands well enough for the force law."""

PULL_TOLERANCE = wp.constant(1.0e-4)
"""The same of a line that pulls where its contact has opened: what others would wrongly move by."""

DEPTH_ROUNDS = wp.constant(6)
"""Most of Newton's steps for a depth that the path asks for; two are enough from that of the round before."""

DEPTH_TOLERANCE = wp.constant(1.0e-2)
"""Relative length of a step after which the depth counts as found: the next would be its square."""

_SETTLED = wp.constant(SETTLED)


@wp.struct
class Depth:
    """Overlap δ that carries the load of a contact above its floor [µm], and by how much it falls as the gap opens."""

    value: float
    slope: float
    by_path: int
    """1: the path asks for it, 0: it is the overlap at the end of the step."""
    above: float
    """s + δ + b [µm], how far the path's end is above its least gap; only with `by_path`."""


@wp.func
def depth_at(c: Contact, opening: float, guess: float) -> Depth:
    """δ(s) at s = `opening` [µm], where the path counts by Newton's steps from `guess` [µm]."""
    d = Depth()
    end = c.overlap - opening
    if end > 0.0:
        d.value = end
        d.slope = 1.0
    if c.wander > 0.0:
        quarter = 0.25 * c.wander
        yields = c.give * c.hardness
        begin = c.layer - c.overlap
        if (yields * d.value * wp.sqrt(d.value) + d.value + begin) * (opening + d.value + begin) < quarter:
            least = d.value
            depth = wp.max(guess, least)
            for _ in range(DEPTH_ROUNDS):
                root = wp.sqrt(depth)
                inverse = 1.0 / (opening + depth + begin)
                kept = quarter * inverse
                rise = 1.5 * yields * root + 1.0 + kept * inverse
                step = (yields * depth * root + depth + begin - kept) / rise
                depth = wp.max(depth - step, least)
                d.slope = kept * inverse / rise
                if wp.abs(step) <= DEPTH_TOLERANCE * depth:
                    break
            d.value = depth
            d.by_path = 1
            d.above = opening + depth + begin
    return d


@wp.func
def lone_depth(c: Contact, apart: float) -> float:
    """δ [µm] of a contact whose gap all but its own load open by `apart` [µm]: about, and 0 if it carries nothing.

    As `overlap_alone`, by three of Newton's steps for w = √δ from √(r/(1 + A√r)), below the root of w² + A w³ = r.
    """
    reach = kept_reach(c, apart)
    depth = float(0.0)
    if reach > 0.0:
        a = c.give * c.hardness
        w = wp.sqrt(reach / (1.0 + a * wp.sqrt(reach)))
        for _ in range(3):
            w = w - (w * w + a * w * w * w - reach) / (2.0 * w + 3.0 * a * w * w)
        depth = w * w
    return depth


@wp.func
def line_error(c: Contact, opening: float, d: Depth, load: float) -> float:
    """By how much the line of a contact misses its law at `opening`, as an error of its gap [µm]; 0 if little.

    `load` [pN] is that of the law.
    """
    line = c.force - c.stiffness * opening
    missed = wp.abs(line - load) * c.give
    allowed = LAW_TOLERANCE * c.radius
    if d.by_path != 0:
        allowed = _SETTLED + PATH_TOLERANCE * d.above
    else:
        missed = missed / (1.0 + 1.5 * c.give * c.hardness * wp.sqrt(d.value))
    if line < c.floor:
        # what it pulls moves others, however little it is in its own gap
        missed = wp.max(missed, (c.floor - line) * c.give)
        allowed = wp.min(allowed, PULL_TOLERANCE * c.radius)
    return wp.where(missed > allowed, missed, 0.0)


@wp.func
def first_line(c: Contact, opening: float) -> wp.vec3:
    """(force, stiffness, δ) of the line of a contact before it is known what the others do.

    Free moves open its gap by `opening` [µm]; the line's load is force − stiffness·s [pN]. It holds where the contact
    would end if it were alone: the tangent there where the path counts, else the chord from the start of the step, so
    that a resting contact keeps its load. A contact that carries nothing by itself gets none.
    """
    apart = opening + c.give * c.floor
    depth = lone_depth(c, apart)
    force = float(c.floor)
    stiffness = float(0.0)
    if depth > 0.0:
        end = wp.sqrt(depth)
        if meets_path(c, apart):
            excess = c.hardness * depth * end
            s = apart + c.give * excess
            stiffness = 1.5 * c.hardness * end * depth_at(c, s, depth).slope
            force = c.floor + excess + stiffness * s
        else:
            start = wp.sqrt(wp.max(c.overlap, 0.0))
            stiffness = c.hardness * (end * end + end * start + start * start) / (end + start)
            force = c.floor + c.hardness * start * start * start
            if c.overlap <= 0.0:
                force = c.floor + stiffness * c.overlap
    return wp.vec3(force, stiffness, depth)
