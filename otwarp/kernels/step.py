"""`make_step`: the kernels that a feature set needs, and no others."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.drivers.coupled_world import make_coupled_step
from otwarp.kernels.drivers.grid.phases import GridPhases, make_grid_phases
from otwarp.kernels.drivers.grid.step import GridKernels, make_grid_step
from otwarp.kernels.drivers.grid.world import make_world_of_many_step
from otwarp.kernels.drivers.lanes import make_lanes_step
from otwarp.kernels.drivers.solo import make_solo_step
from otwarp.kernels.drivers.world import make_world_step
from otwarp.kernels.drivers.world_phases import WorldPhases, make_world_phases
from otwarp.kernels.forces.readout import make_force_readout
from otwarp.kernels.optics.readout import make_trap_readout


@dataclass(frozen=True, kw_only=True)
class Step:
    """The composed kernels of one feature set.

    Attributes:
        features: What they were composed from.
        fused: The single kernel of the drivers that take many steps in a launch, or None.
        phases: Those of a driver in phases, or None.
        grid: The grid driver's kernels, or None.
        readout: Trap readout kernels (per trap and body, per hand), empty without traps.
        forces: Readout of the forces with parameters, or None without such.
    """

    features: Features
    fused: wp.Kernel | None = None
    phases: WorldPhases | GridPhases | None = None
    grid: GridKernels | None = None
    readout: tuple[wp.Kernel, ...] = ()
    forces: wp.Kernel | None = None

    @property
    def kernels(self) -> list[wp.Kernel]:
        """All kernels, in launch order."""
        fused = [self.fused] if self.fused is not None else []
        parts = self.grid or self.phases
        return [*fused, *(parts.all if parts is not None else ()), *self.measuring]

    @property
    def measuring(self) -> list[wp.Kernel]:
        """Kernels that read out and do not step."""
        return [*self.readout, *([self.forces] if self.forces is not None else [])]


@functools.lru_cache(maxsize=64)
def make_step(features: Features) -> Step:
    """Compose the step of a scene. Equal feature sets share their kernels."""
    one_by_one = replace(features, team=1)
    readout = make_trap_readout(one_by_one) if features.trap_models else ()
    forces = make_force_readout(one_by_one) if features.forces else None
    measured = {"readout": readout, "forces": forces}
    # these have no float64 instance, and Warp would let them read its structs as their own
    assert features.precision == "float32" or not (features.lanes or features.driver == "grid")
    if features.driver == "solo":
        fused = make_lanes_step(features) if features.lanes else make_solo_step(features)
        return Step(features=features, fused=fused, **measured)
    if features.phased:
        phases = make_grid_phases(features) if features.driver == "grid" else make_world_phases(features)
        return Step(features=features, phases=phases, **measured)
    if features.driver == "world":
        make = make_coupled_step if features.coupling else make_world_step
        return Step(features=features, fused=make(features), **measured)
    if features.by_world:
        return Step(features=features, fused=make_world_of_many_step(features), **measured)
    return Step(features=features, grid=make_grid_step(features), **measured)
