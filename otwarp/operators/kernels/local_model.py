"""The force on the spheres near a hand's traps: twin of `otwarp.haptics.force.LocalModel`.

Every hand has spheres of its own: where they were published, and, if they glide, where they have come to. The terms are
those that the simulation's kernels and the servo's machine code are made of, in float64.
"""

import warp as wp

from otwarp.haptics.force import MEMORY
from otwarp.kernels.core.precision import kernel_module
from otwarp.laws import local_rows
from otwarp.operators.kernels.features import ChainFeatures

_local_force = kernel_module("optics.local_force", "float64")
_types = kernel_module("core.types", "float64")
law_of = _local_force.law_of
TrapData = _types.TrapData
ForceTableData = kernel_module("core.table_data", "float64").ForceTableData


@wp.struct
class Felt:
    """What hands can feel: H hands of a world with up to T traps each, S spheres of K kinds. The same in all worlds."""

    trap_count: wp.array(dtype=wp.int32)  # (H)
    trap: wp.array2d(dtype=wp.int32)  # (H, T) in the scene, ascending
    law: wp.array3d(dtype=wp.int32)  # (H, T, K) row of the law
    row: wp.array2d(dtype=wp.float64)  # (laws, numbers) see `otwarp.laws.local_rows.LAW`
    first: wp.array(dtype=wp.int32)  # (K + 1) first sphere of each kind
    tables: ForceTableData
    alpha: wp.array(dtype=wp.float64)  # (H) share of their way that gliding spheres go each period


@wp.struct
class Published:
    """What the simulations published, (W, …)."""

    sphere: wp.array2d(dtype=wp.vec3d)  # (W, S) [µm]
    body: wp.array2d(dtype=wp.int32)  # (W, S) whose it is
    trap: wp.array2d(dtype=wp.vec3d)  # (W, all traps) [µm]
    power: wp.array2d(dtype=wp.float64)  # (W, all traps) [mW]
    time: wp.array(dtype=wp.float64)  # (W) [s]
    beat: wp.array(dtype=wp.int32)  # (W) counts states


@wp.struct
class Spheres:
    """Spheres and traps of every hand of every world, N = W·H; arrays of parts that no hand has are empty."""

    target: wp.array2d(dtype=wp.vec3d)  # (N, S) where they were published [µm]
    place: wp.array2d(dtype=wp.vec3d)  # (N, S) where they have glided to [µm]
    body: wp.array2d(dtype=wp.int32)  # (N, S)
    went: wp.array2d(dtype=wp.float64)  # (N, S) Σ way of sphere · way of trap [µm²]
    share: wp.array2d(dtype=wp.float64)  # (N, S) of the traps' way that they follow
    anchor: wp.array2d(dtype=wp.vec3d)  # (N, T) traps before the hand carried them [µm]
    power: wp.array2d(dtype=wp.float64)  # (N, T) [mW]


@wp.struct
class ModelState:
    """Of one hand of one world."""

    filled: wp.int32  # whether a state was taken in
    time: wp.float64  # of it [s]
    focus: wp.vec3d  # first trap in the state learned from last [µm]
    focused: wp.int32  # whether that is known
    carried: wp.vec3d  # how far the traps were carried in the newest state [µm]
    way: wp.float64  # Σ (way of trap)² [µm²]
    learned: wp.int32  # whether shares are known


@wp.func
def is_finite(v: wp.vec3d) -> bool:
    """Whether a vector in any units is one of numbers."""
    return wp.isfinite(v[0] + v[1] + v[2])


@wp.func
def anchor_of(
    felt: Felt, published: Published, spheres: Spheres, world: int, hand: int, n: int, t: int, anew: int
) -> wp.vec3d:
    """Place of the t-th trap of a hand before it carried it [µm]: as published, if the hand takes hold `anew`."""
    place = spheres.anchor[n, t]
    if anew != 0:
        place = published.trap[world, felt.trap[hand, t]]
    return place


@wp.func
def all_finite(
    felt: Felt, published: Published, spheres: Spheres, world: int, hand: int, n: int, anew: int
) -> bool:  # fmt: skip
    """Whether all numbers [µm, mW] of the newest state that this hand needs are finite."""
    total = wp.vec3d()
    for k in range(published.sphere.shape[1]):
        total += published.sphere[world, k]
    power = wp.float64(0.0)
    for t in range(felt.trap_count[hand]):
        total += anchor_of(felt, published, spheres, world, hand, n, t, anew)
        power += published.power[world, felt.trap[hand, t]]
    total += published.trap[world, felt.trap[hand, 0]]
    return is_finite(total) and wp.isfinite(power)


@wp.func
def learned(published: Published, spheres: Spheres, state: ModelState, world: int, n: int, focus: wp.vec3d
) -> ModelState:  # fmt: skip
    """How much of its trap's way each sphere went lately; `focus` is the hand's first trap [µm]."""
    out = state
    memory = wp.static(wp.float64(MEMORY))
    zero = wp.float64(0.0)
    out.focus = focus
    out.focused = 1
    if state.filled == 0 or state.focused == 0:
        out.learned = 0
        out.way = zero
        for k in range(published.sphere.shape[1]):
            spheres.went[n, k] = zero
    else:
        step = focus - state.focus
        out.way = memory * state.way + step[0] * step[0] + step[1] * step[1] + step[2] * step[2]
        out.learned = wp.where(out.way > zero, 1, 0)
        for k in range(published.sphere.shape[1]):
            went = published.sphere[world, k] - spheres.target[n, k]
            total = memory * spheres.went[n, k] + step[0] * went[0] + step[1] * went[1] + step[2] * went[2]
            spheres.went[n, k] = total
            if out.way > zero:
                spheres.share[n, k] = wp.min(wp.max(total / out.way, zero), wp.float64(1.0))
    return out


def exchanging(features: ChainFeatures) -> wp.Function:
    """`(published, spheres, world, n) -> stood`: slots that went to another body have its sphere at once."""

    @wp.func
    def exchanged(published: Published, spheres: Spheres, world: int, n: int) -> int:
        """A slot that went to another body has its sphere at once; 1 if all spheres stand as published before [µm]."""
        stood = int(1)
        for k in range(published.sphere.shape[1]):
            now = published.sphere[world, k]
            if published.body[world, k] != spheres.body[n, k]:
                spheres.target[n, k] = now
                if wp.static(features.glides):
                    spheres.place[n, k] = now
                if wp.static(features.predicts):
                    spheres.went[n, k] = wp.float64(0.0)
            then = spheres.target[n, k]
            if now[0] != then[0] or now[1] != then[1] or now[2] != then[2]:
                stood = 0
        return stood

    return exchanged


def taking_in(features: ChainFeatures) -> wp.Function:
    """`(felt, published, spheres, state, world, hand, n, anew) -> state`: a newly published state, all of it finite."""
    exchanged = exchanging(features)

    @wp.func
    def take_in(
        felt: Felt, published: Published, spheres: Spheres, state: ModelState, world: int, hand: int, n: int, anew: int
    ) -> ModelState:
        """The model with the newest state; traps stand where they were before the hand carried them [µm]."""
        out = state
        stood = int(0)
        if state.filled != 0:
            stood = exchanged(published, spheres, world, n)
            if published.time[world] != state.time:
                stood = 0
        for t in range(felt.trap_count[hand]):
            spheres.anchor[n, t] = anchor_of(felt, published, spheres, world, hand, n, t, anew)
            spheres.power[n, t] = published.power[world, felt.trap[hand, t]]
        focus = published.trap[world, felt.trap[hand, 0]]
        if wp.static(features.predicts):
            if stood == 0:
                out = learned(published, spheres, out, world, n, focus)
            out.carried = focus - spheres.anchor[n, 0]
        for k in range(published.sphere.shape[1]):
            now = published.sphere[world, k]
            spheres.target[n, k] = now
            spheres.body[n, k] = published.body[world, k]
            if wp.static(features.glides):
                if state.filled == 0:
                    spheres.place[n, k] = now
        out.time = published.time[world]
        out.filled = 1
        return out

    return take_in


def pulling(features: ChainFeatures) -> wp.Function:
    """`(felt, spheres, state, hand, n, carried) -> force`: Σ F of a hand's traps on all spheres [pN]."""
    force_at = _local_force.felt_term(features.models)
    tabled = any(name.startswith("table") for name in features.models)

    @wp.func
    def glide(spheres: Spheres, n: int, alpha: wp.float64):
        """Move the spheres one servo period on towards where they were last published [µm]."""
        for k in range(spheres.target.shape[1]):
            now = spheres.place[n, k]
            spheres.place[n, k] = now + alpha * (spheres.target[n, k] - now)

    @wp.func
    def place_now(spheres: Spheres, state: ModelState, n: int, k: int, ahead: wp.vec3d) -> wp.vec3d:
        """Where sphere k has come to [µm], with the hand's traps `ahead` [µm] of the newest state."""
        place = spheres.target[n, k]
        if wp.static(features.glides):
            place = spheres.place[n, k]
        if wp.static(features.predicts):
            if state.learned != 0:
                place = place + spheres.share[n, k] * ahead
        return place

    @wp.func
    def pull(felt: Felt, spheres: Spheres, state: ModelState, hand: int, n: int, carried: wp.vec3d) -> wp.vec3d:
        """Σ F [pN] on the spheres with the hand's traps carried so far [µm]."""
        if wp.static(features.glides):
            glide(spheres, n, felt.alpha[hand])
        ahead = carried - state.carried
        traps = TrapData()
        traps.tables = felt.tables
        total = wp.vec3d()
        for t in range(felt.trap_count[hand]):
            place = spheres.anchor[n, t] + carried
            for kind in range(felt.first.shape[0] - 1):
                one = felt.law[hand, t, kind]
                law = law_of(felt.row[one])
                if wp.static(tabled):
                    if law.table >= 0:
                        law.finest = felt.tables.level[felt.tables.level_start[law.table]]
                focus = place + felt.row[one, wp.static(local_rows.LAW.index("equilibrium"))] * law.axis
                pulled = wp.vec3d()
                for k in range(felt.first[kind], felt.first[kind + 1]):
                    displacement = place_now(spheres, state, n, k, ahead) - focus
                    d2 = wp.dot(displacement, displacement)
                    if d2 < law.reach2:
                        pulled += force_at(traps, law, displacement)
                    elif wp.isnan(d2):
                        pulled += wp.vec3d(d2, d2, d2)  # what is no number must be seen in the sum
                total += spheres.power[n, t] * pulled
        return total

    return pull
