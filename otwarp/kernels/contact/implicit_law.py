"""The force of a contact as a function of how far its gap opens in a step, and its tangents.

With s the opening of the gap, λ = floor + K·δ^{3/2}, and δ(s) is the larger of Hertz's overlap − s and of what the
path asks for (`excursion`): with b = layer − overlap the root of

    give·K·δ^{3/2} + δ + b = W/4 / (s + δ + b),

whose left side rises and whose right side falls with δ, and which lies below Hertz's where that asks for more. λ falls
with s, so that the forces of any number of contacts together follow from the least of a convex energy, see
`body_solve`.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.excursion import kept_reach, meets_path
from otwarp.kernels.core.roots import reciprocal, square_root

DEPTH_ROUNDS = wp.constant(6)
"""Most of Newton's steps for a depth that the path asks for; two are enough from that of the round before."""

DEPTH_TOLERANCE = wp.constant(1.0e-2)
"""Relative length of a step after which the depth counts as found: the next would be its square."""


@wp.struct
class Depth:
    """Overlap δ that carries the load of a contact above its floor [µm], and by how much it falls as the gap opens."""

    value: float
    slope: float


@wp.struct
class Line:
    """Load of a contact [pN] as a line at an opening of its gap, how it falls there [pN/µm], and δ [µm]."""

    load: float
    slope: float
    depth: float


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
        if (yields * d.value * square_root(d.value) + d.value + begin) * (opening + d.value + begin) < quarter:
            least = d.value
            depth = wp.max(guess, least)
            for _ in range(DEPTH_ROUNDS):
                root = square_root(depth)
                inverse = reciprocal(opening + depth + begin)
                kept = quarter * inverse
                fall = reciprocal(1.5 * yields * root + 1.0 + kept * inverse)
                step = (yields * depth * root + depth + begin - kept) * fall
                depth = wp.max(depth - step, least)
                d.slope = kept * inverse * fall
                if wp.abs(step) <= DEPTH_TOLERANCE * depth:
                    break
            d.value = depth
    return d


@wp.func
def tangent(c: Contact, opening: float, guess: float) -> Line:
    """The law at s = `opening` [µm], and its tangent; `guess` as in `depth_at`."""
    d = depth_at(c, opening, guess)
    root = square_root(d.value)
    return Line(c.floor + c.hardness * d.value * root, 1.5 * c.hardness * root * d.slope, d.value)


@wp.func
def lone_depth(c: Contact, apart: float) -> float:
    """δ [µm] of a contact whose gap all but its own load open by `apart` [µm]: about, and 0 if it carries nothing.

    As `overlap_alone`, by three of Newton's steps for w = √δ from √(r/(1 + A√r)), below the root of w² + A w³ = r.
    """
    reach = kept_reach(c, apart)
    depth = float(0.0)
    if reach > 0.0:
        a = c.give * c.hardness
        w = square_root(reach * reciprocal(1.0 + a * square_root(reach)))
        for _ in range(3):
            w = w - (w * w + a * w * w * w - reach) * reciprocal(2.0 * w + 3.0 * a * w * w)
        depth = w * w
    return depth


@wp.func
def first_line(c: Contact, opening: float) -> Line:
    """The line, at `opening` [µm], of a contact before it is known what the others do: its tangent where it would end.

    Free moves open its gap by `opening`, and nothing else but its load. What carries nothing by itself has no slope.
    """
    apart = opening + c.give * c.floor
    depth = lone_depth(c, apart)
    line = Line(c.floor, 0.0, depth)
    if depth > 0.0:
        root = square_root(depth)
        yields = c.give * c.hardness * root
        load = c.floor + c.hardness * depth * root
        line.slope = 1.5 * c.hardness * root
        if meets_path(c, apart):
            # as in `depth_at`, W/4 / (s + δ + b)² of the law that is obeyed there
            inverse = reciprocal(opening + c.give * load + depth + c.layer - c.overlap)
            bend = 0.25 * c.wander * inverse * inverse
            line.slope *= bend * reciprocal(1.5 * yields + 1.0 + bend)
        line.load = load * (1.0 + c.give * line.slope)
    return line


@wp.func
def line_of(c: Contact, opening: float, guess: float, first: bool) -> Line:
    """The line at s = `opening` [µm]: the law's tangent, or that of a contact alone if it is the `first` of a solve."""
    line = Line()
    if first:  # noqa: SIM108 (Warp would work out both)
        line = first_line(c, opening)
    else:
        line = tangent(c, opening, guess)
    return line
