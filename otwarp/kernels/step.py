"""`make_step`: the kernels that a feature set needs, and no others."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import warp as wp

from otwarp.kernels.features import Features
from otwarp.kernels.grid import make_advance, make_commit, make_move_traps
from otwarp.kernels.grid_contacts import make_find, make_relax, make_weigh
from otwarp.kernels.readout import make_trap_readout
from otwarp.kernels.solo import make_solo_step
from otwarp.kernels.world import make_world_step


@dataclass(frozen=True, kw_only=True)
class Step:
    """The composed kernels of one feature set.

    Attributes:
        features: What they were composed from.
        fused: The world drivers' single kernel, or None.
        move_traps, advance, find, weigh, relax, commit: The body driver's kernels in launch order, None if not needed.
        readout: Trap readout kernels (per trap, per sphere, per hand), empty without traps.
    """

    features: Features
    fused: wp.Kernel | None = None
    move_traps: wp.Kernel | None = None
    advance: wp.Kernel | None = None
    find: wp.Kernel | None = None
    weigh: wp.Kernel | None = None
    relax: wp.Kernel | None = None
    commit: wp.Kernel | None = None
    readout: tuple[wp.Kernel, ...] = ()

    @property
    def kernels(self) -> list[wp.Kernel]:
        """All kernels, in launch order."""
        parts = [
            self.fused,
            self.move_traps,
            self.advance,
            self.find,
            self.weigh,
            self.relax,
            self.commit,
            *self.readout,
        ]
        return [k for k in parts if k is not None]


@functools.lru_cache(maxsize=64)
def make_step(features: Features) -> Step:
    """Compose the step of a scene. Equal feature sets share their kernels."""
    readout = make_trap_readout(features) if features.trap_models else ()
    if features.driver == "solo":
        return Step(features=features, fused=make_solo_step(features), readout=readout)
    if features.driver == "world":
        return Step(features=features, fused=make_world_step(features), readout=readout)
    return Step(
        features=features,
        move_traps=make_move_traps(features) if features.speed_limits else None,
        advance=make_advance(features),
        find=make_find(features) if features.contacts else None,
        weigh=make_weigh(features) if features.contacts else None,
        relax=make_relax(features) if features.contacts else None,
        commit=make_commit(features),
        readout=readout,
    )
