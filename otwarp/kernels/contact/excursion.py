"""Thermal excursions of a gap within a step: how hard a contact must push that a Brownian path meets in between.

A path may touch a wall and be away from it again when the step ends. A step that looks at its end alone lets a bead
sink by a share of the step's own spread s, whatever the time step: its mean height errs by O(√dt). Between gaps g₀ at
the start and g₁ at the free end of a step the path is a Brownian bridge of variance s² = 2 k_BT·give; its least gap is

    m = ½ (g₀ + g₁ − √((g₁ − g₀)² − 2 s² ln U))

with U uniform in (0, 1], and a wall that is hard pushes by max(−m, 0): this is the exact step of reflected Brownian
motion (Asmussen, Glynn, Pitman 1995, doi:10.1214/aoap/1177004597). An elastic wall does so only for what an excursion
reaches beyond the layer that thermal motion enters anyway. By Boltzmann's distribution of Hertz's energy ⅖·K·δ^{5/2} a
wall stands back by ∫exp(−⅖·K·δ^{5/2}/k_BT) dδ = Γ(7/5)·δ_T with δ_T = (5 k_BT/2K)^{2/5}; backward Euler yields some of
that by itself, and `LAYER` is what is left. Where δ_T is larger than s, at κ = k·give ≲ 1, the step resolves the wall
and nothing is left of the excursion.

Near a hydrodynamic wall mobility falls with the gap and the path slows down on its way; the bridge has the spread of
the start, which keeps paths off a little too well where steps are far longer than chosen.

The push is the least load that the contact carries in the step, not one on top of what it would carry: where others
hold the gap closed the excursion adds nothing, and no set of excursions asks for what cannot be.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact, overlap_alone
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import thermal_energy_of
from otwarp.kernels.core.random import Stream, noise_words, squared_radius
from otwarp.kernels.core.types import ModelData

LAYER = wp.constant(0.75)
"""Depth of the thermal layer over δ_T, Γ(7/5) = 0.887 less what backward Euler yields: by emulation in one dimension
(κ from 0.1 to 10⁴, a spring of k·dt/γ = 0.19 that presses by up to 4·k_BT/s) the mean height then errs by at most 0.03
of its standard deviation. The standard deviation itself is up to a third too small for loaded contacts of κ from 1 to
30, as without excursions: backward Euler damps what it does not resolve."""

FARTHEST = wp.constant(3.0)
"""Gap, in s, beyond which a path is taken never to touch: it does once in e¹⁸ = 7·10⁷ steps."""

SOFT = wp.constant(5.0)
"""Depth of the thermal layer, in s, from which on excursions are all resolved."""


@wp.func
def obstacle_name(o: int) -> int:
    """Number of obstacle `o` as the partner of an element: no element has it."""
    return -1 - o


def excursion_term(f: Features) -> wp.Function:
    """`(model, world, c, opening, first, second, which, step) -> Contact`: draw what the gap's path does in this step.

    `opening` [µm] is that by the free moves; `first` and `second` are the numbers of the touching elements (or
    `obstacle_name`), in either order, and `which` tells several contacts of one pair apart, 0 to 3. A contact that its
    path cannot reach, or that is soft, draws nothing; nor does any without noise.
    """

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
        end = opening - c.overlap
        near = c.overlap >= 0.0 or end <= 0.0 or -c.overlap * end < FARTHEST * FARTHEST * variance
        if near and variance > 0.0:
            layer = LAYER * wp.pow(2.5 * energy / c.hardness, 0.4)
            if layer * layer < SOFT * SOFT * variance:
                low = wp.min(first, second)
                high = wp.max(first, second)
                # the second number goes with the stream, because the counter has room for one
                stream = wp.static(wp.uint32(Stream.CONTACT)) + (wp.uint32(high) << wp.uint32(8))
                words = noise_words(model.seed, stream, step, world, low)
                c.wander = variance * squared_radius(words[which])
                c.layer = layer
        return c

    return excursion if f.brownian else still


@wp.func
def least_load(c: Contact, opening: float) -> float:
    """Least load of a contact whose free moves open its gap by `opening` [µm] in the step [pN].

    Its floor without noise; else what backward Euler makes of the contact alone if its gap ended lower by
    g₁ − m − layer.
    """
    load = c.floor
    if c.wander > 0.0:
        lower = 0.5 * (opening + wp.sqrt(opening * opening + c.wander)) - c.layer
        reach = c.overlap - opening + lower - c.give * c.floor
        if lower > 0.0 and reach > 0.0:
            end = overlap_alone(c.hardness, c.give, reach)
            load += c.hardness * end * wp.sqrt(end)
    return load


@wp.func
def shared_load(own: float, give: float, opened: float) -> float:
    """Load above its floor of a contact that alone would need `own` [pN], where others open its gap by `opened` [µm].

    `opened` is Σ G·own over the contacts that open it, G the opening per unit force. Contacts drawn each for itself
    would lift a body that lies on several of them by several excursions. Shares own·give/(own·give + opened) let equal
    contacts keep out their excursion exactly, whatever their G, and leave little to one whose gap another one opens
    anyway; in between gaps miss theirs by less than a tenth.
    """
    load = float(0.0)
    if own > 0.0:
        load = own * (own * give / (own * give + opened))
    return load
