"""The law of one contact in a sweep over shared entries: where it ends, what it still lacks, and how far to go on.

It is that of `contacts` with the root w of its overlap δ = w² as the unknown, of which all that a sweep asks for are
powers.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact, nearer_root
from otwarp.kernels.contact.excursion import reach_beyond
from otwarp.kernels.core.roots import cube_root, square_root

FARTHER = wp.constant(0.8)
"""How far a sweep goes on beyond its own end where conditions are moderate, see `momentum_of`."""

LEAST_KEPT = wp.constant(1.0e-12)
"""What a load keeps out counts as nothing below this [µm]: a millionth of the tolerance."""


@wp.func
def path_reach(c: Contact, opened: float, start: float, row_sum: float) -> float:
    """`excursion.swept_reach` [µm] of a contact whose gap a load of `start` [pN] leaves open by `opened` [µm]."""
    reach = float(-1.0)
    if c.wander > 0.0:
        above = (start - c.floor) * c.give
        root = float(0.0)
        if above > 0.0:
            root = cube_root(above / (c.give * c.hardness))
        reach = reach_beyond(c, opened, above, root * root, row_sum)
    return reach


@wp.func
def end_root(c: Contact, opened: float, start: float, row_sum: float, reach: float) -> float:
    """Root of the overlap [µm^{1/2}] at which a contact ends whose gap a load of `start` [pN] leaves open by `opened`.

    Where its path asks for a `reach` [µm] it is that of the contact alone; else backward Euler's, as if the gap gave
    way by row_sum·give.
    """
    give = row_sum * c.give
    kept = c.overlap - opened + give * (start - c.floor)
    if reach > 0.0:
        give = c.give
        kept = reach
    root = float(0.0)
    if kept > LEAST_KEPT:
        # from within a third of the root four steps are as many as float32 has digits for
        a = give * c.hardness
        root = wp.min(square_root(kept), cube_root(kept / a))
        for _ in range(4):
            root = nearer_root(root, a, kept)
    return root


@wp.func
def momentum_of(c: Contact, give: float, root: float, start: float, load: float, sweep: int) -> float:
    """What a sweep that led from `start` to `load` adds for the next [pN]; none where it went too far: restart.

    A share of the change since the sweep before, as in `contacts`, and where conditions are moderate some of the
    sweep's own: nearer to Chebyshev's iteration, which on a linear law is almost twice as fast.
    """
    condition = square_root(1.0 + 1.5 * give * c.hardness * root)
    share = (condition - 1.0) / (condition + 1.0)
    ahead = FARTHER * wp.min(share, 1.0 - share) * (load - start)
    ahead += wp.min(share, float(sweep) / float(sweep + 3)) * (load - c.load)
    return wp.where((start - load) * (load - c.load) <= 0.0, ahead, 0.0)


@wp.func
def error_alone(c: Contact, row_sum: float, root: float, reach: float, change: float) -> float:
    """How far from its law a contact is [µm] whose load a sweep would change by `change` [pN].

    What the load that it lacks with all others at rest would move: by the slope of Hertz's law at the overlap at which
    the sweep has it end, and at most row_sum times the change, as where its path asks for a `reach`.
    """
    more = row_sum
    if reach <= 0.0:
        rigidity = 1.5 * c.give * c.hardness * root
        more = (1.0 + row_sum * rigidity) / (1.0 + rigidity)
    return more * wp.abs(change) * c.give
