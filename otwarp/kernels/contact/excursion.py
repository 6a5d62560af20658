"""Thermal excursions of a gap within a step: how hard a contact pushes that a Brownian path meets in between.

A path may touch a wall and be away from it again when the step ends. A step that looks at its end alone lets a bead
sink by a share of the step's own spread s, whatever the time step: its mean height errs by O(√dt). Between gaps g₀ at
the start and g₀ + p at the free end of a step the path is a Brownian bridge of variance s² = 2 k_BT·give; its least gap
is, with U uniform in (0, 1],

    m = g₀ + ½ (p − √(p² + W)),  W = −2 s² ln U,

and a wall that is hard pushes by x = max(−m, 0): this is the exact step of reflected Brownian motion (Asmussen, Glynn,
Pitman 1995, doi:10.1214/aoap/1177004597). Solved for the gap g at the end, it is a law of force like Hertz's,

    x = give·λ = W/4g − g₀ where that is positive,

which falls with the gap and so has one solution with any other contacts: p is what the gap opens by moves and by all
contact forces but its own. Between two walls much nearer than s the gaps are as W to W', so that places are uniform.

An elastic wall pushes so only for what an excursion reaches beyond the layer that thermal motion enters anyway. By
Boltzmann's distribution of Hertz's energy ⅖·K·δ^{5/2} a wall stands back by ∫exp(−⅖·K·δ^{5/2}/k_BT) dδ = Γ(7/5)·δ_T
with δ_T = (5 k_BT/2K)^{2/5}; backward Euler yields some of that by itself, and `layer_depth` is what is left. Where δ_T
is larger than s, at κ = k·give ≲ 1, the step resolves the wall and nothing is left of the excursion. With the overlap δ
of its load an elastic contact obeys

    (give·λ + g₀ + δ + layer)·(g + δ + layer) = W/4,

all of λ above its floor; or Hertz's law, where that asks for more.

Near a hydrodynamic wall mobility falls with the gap and the path slows down on its way; the bridge has the spread of
the start, which keeps paths off a little too well where steps are far longer than chosen.
"""

import warp as wp

from otwarp.kernels.contact.contact import FIRST_OVERLAP, SETTLED, Contact, overlap_alone
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import thermal_energy_of
from otwarp.kernels.core.random import Stream, noise_words, squared_radius
from otwarp.kernels.core.roots import reciprocal, square_root
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.core.worlds import number_term

LAYER = wp.constant(0.75)
"""Depth of the thermal layer of a hard contact over δ_T: Γ(7/5) = 0.887 less what backward Euler yields."""

YIELD_APART, YIELD_IN = wp.constant(0.3), wp.constant(0.15)
"""What a soft contact yields more, see `layer_depth`: where its step starts apart, and where it starts in touch."""

RESOLVED = wp.constant(15.0)
"""κ at which it yields half of that."""

PATH_TOLERANCE = wp.constant(0.02)
"""Error of a gap, relative to how far its end is above the least gap of its path, with which it counts as solved."""

FARTHEST = wp.constant(3.0)
"""Gap, in s, beyond which a path is taken never to touch: it does once in e¹⁸ = 7·10⁷ steps."""

SOFT = wp.constant(5.0)
"""`LAYER`·δ_T, in s, from which on excursions are all resolved."""


@wp.func
def layer_depth(kappa: float, overlap: float) -> float:
    """Depth of the thermal layer over δ_T, `LAYER` − Y/(1 + κ/`RESOLVED`), κ = k·give with Hertz's k at δ_T.

    A step whose κ is moderate resolves some of the layer: a path that comes from outside meets a wall that yields in
    the same step, and enters deeper than Boltzmann has it. Fitted to an emulation in one dimension, κ from 0.3 to 300:
    of a free gap, overlaps are as frequent as Boltzmann's to 5 % (by `LAYER` alone 16 % too frequent at κ from 2 to
    10); of one that is pressed by ½ to 4 k_BT/s, the mean is right to 0.03 of its standard deviation (0.04). That
    standard deviation is up to a third too small for loaded contacts of κ from 1 to 30, as without excursions: backward
    Euler damps what it does not resolve.
    """
    return LAYER - wp.where(overlap > 0.0, YIELD_IN, YIELD_APART) / (1.0 + kappa / RESOLVED)


@wp.func
def obstacle_name(o: int) -> int:
    """Number of obstacle `o` as the partner of an element: no element has it."""
    return -1 - o


def excursion_term(f: Features) -> wp.Function:
    """`(model, world, c, opening, first, second, which, step) -> Contact`: draw what the gap's path does in this step.

    `opening` [µm] is that by the free moves; adhesion pulls on the path beside them. `first` and `second` are the
    numbers of the touching elements (or `obstacle_name`), in either order, and `which` tells several contacts of one
    pair apart, 0 to 3. A contact that its path cannot reach, or that is soft, draws nothing, nor does any without
    noise.
    """
    number = number_term(f)

    @wp.func
    def still(
        model: ModelData, world: int, c: Contact, opening: float, first: int, second: int, which: int, step: wp.int64
    ) -> Contact:
        """The contact unchanged: without noise the path has no excursion."""
        return c

    @wp.func
    def excursion(
        model: ModelData, world: int, c: Contact, opening: float, first: int, second: int, which: int, step: wp.int64
    ) -> Contact:
        """The contact with −2 s² ln U and its thermal layer drawn, where its path may reach the wall in this step."""
        energy = thermal_energy_of(model, world)
        variance = 2.0 * energy * c.give
        end = opening + c.give * c.floor - c.overlap
        near = c.overlap >= 0.0 or end <= 0.0 or -c.overlap * end < FARTHEST * FARTHEST * variance
        if near and variance > 0.0:
            depth = wp.pow(2.5 * energy / c.hardness, 0.4)
            layer = LAYER * depth
            if layer * layer < SOFT * SOFT * variance:
                low = wp.min(first, second)
                high = wp.max(first, second)
                # the second number goes with the stream, because the counter has room for one
                stream = wp.static(wp.uint32(Stream.CONTACT)) + (wp.uint32(high) << wp.uint32(8))
                words = noise_words(model.seed, stream, step, number(model, world), low)
                c.wander = variance * squared_radius(words[which])
                c.layer = depth * layer_depth(1.5 * c.hardness * square_root(depth) * c.give, c.overlap)
        return c

    return excursion if f.brownian else still


@wp.func
def above_least(apart: float, wander: float) -> float:
    """½ (p + √(p² + W)): how far the end of a path is above its least gap [µm], where it opens by p = `apart` [µm]."""
    larger = 0.5 * (wp.abs(apart) + square_root(apart * apart + wander))
    above = larger
    if apart < 0.0:
        above = 0.25 * wander * reciprocal(larger)
    return above


@wp.func
def meets_path(c: Contact, apart: float) -> bool:
    """Whether the path reaches deeper than the layer below its end, so that Hertz's law at the end is not enough."""
    return c.wander > 0.0 and above_least(apart, c.wander) > c.layer


@wp.func
def kept_reach(c: Contact, apart: float) -> float:
    """What the load of a contact above its floor has to keep out [µm], give·λ + δ; no load where it is negative.

    `apart` [µm] is how far the gap opens by all but that load. Without a wander it is Hertz's law alone.
    """
    reach = c.overlap - apart
    if meets_path(c, apart):
        # ½ (√(p² + W) − p) in place of −p
        reach = c.overlap + above_least(-apart, c.wander) - c.layer
    return reach


@wp.func
def path_tangent(c: Contact, apart: float) -> Contact:
    """The contact with the tangent to its law as a line, where all but its load open its gap by `apart` [µm].

    A lone contact is thereby solved exactly. With x = give·λ the law has the slope −Θ = −ηθ in p, by its stiffness,
    η = k·give/(1 + k·give), and by its path, θ = ½ (1 − p/√(p² + W)); so the line has the slope Θ/(1 − Θ)/give in the
    gap at the end. Where nothing is to be kept out, the line starts where something would be.
    """
    reach = kept_reach(c, apart)
    place = float(apart)
    end = FIRST_OVERLAP * c.radius
    excess = float(0.0)
    yields = c.give * c.hardness * square_root(end)
    if reach > 0.0:
        end = overlap_alone(c.hardness, c.give, reach)
        yields = c.give * c.hardness * square_root(end)
        excess = yields * end
        yields *= 1.5
    else:
        start = wp.max(c.layer - c.overlap, wp.static(SETTLED))
        place = 0.25 * c.wander / start - start
    up = above_least(place, c.wander)
    down = above_least(-place, c.wander)
    # θ = down/(up + down), η = yields/(1 + yields); no differences of numbers near 1
    follows = down * yields
    slack = up * (1.0 + yields) + down
    c.stiffness = follows / (slack * c.give)
    # above the floor x = (x₀ + Θ (place − s))/(1 − Θ), s the whole opening
    c.force = c.floor + ((up + down) * (1.0 + yields) * excess + follows * place) / (slack * c.give)
    return c


@wp.func
def path_tolerance(c: Contact, reach: float) -> float:
    """Error [µm] that a gap may have where its path asks for `reach` > 0: a share of its end above the least gap."""
    return wp.where(reach > 0.0, PATH_TOLERANCE * 0.25 * c.wander / (reach + c.layer - c.overlap), 0.0)


@wp.func
def swept_reach(c: Contact, opening: float, start: float, row_sum: float) -> float:
    """`kept_reach` of a contact whose gap, open by `opening` [µm] at a load of `start` [pN], gives way row_sum·give.

    Negative also where Hertz's law at the end is enough.
    """
    reach = float(-1.0)
    if c.wander > 0.0:
        ahead = (start - c.floor) * c.give
        overlap = float(0.0)
        if ahead > 0.0:
            overlap = wp.pow(ahead / (c.give * c.hardness), 2.0 / 3.0)
        reach = reach_beyond(c, opening, ahead, overlap, row_sum)
    return reach


@wp.func
def reach_beyond(c: Contact, opening: float, ahead: float, overlap: float, row_sum: float) -> float:
    """`swept_reach` of a path where the load above the floor keeps out `ahead` [µm] at an overlap of `overlap` [µm]."""
    reach = float(-1.0)
    if c.wander > 0.0:
        begin = c.layer - c.overlap
        end = begin + opening + overlap - row_sum * (ahead + overlap)
        # (reach + begin)·(end + row_sum·reach) = W/4, of two roots the positive one
        kept = above_least(row_sum * begin - end, row_sum * c.wander) / row_sum
        if 0.25 * c.wander > c.layer * kept:
            reach = kept - begin
    return reach
