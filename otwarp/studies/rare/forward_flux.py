"""Forward-flux sampling: the flux out of the basin times the probabilities to come from one interface to the next.

Allen, Valeriani & ten Wolde 2009, doi:10.1088/0953-8984/21/46/463102. Nothing is asked of the dynamics but that it goes
on from a state, so traps may move and forces need not be conservative. Sets of states are defined at looks; an escape
between them, or between two time steps, has crossed all interfaces that were left, in whatever stage it happens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.studies.rare.basin import flux
from otwarp.studies.rare.ensemble import FAULT, LOST, UP, Ensemble, Paths
from otwarp.studies.rare.layout import Layout, spread
from otwarp.studies.rare.placement import MOST, Placement
from otwarp.studies.rare.states import States


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """What G runs have found.

    Attributes:
        flux: (G) crossings of the first interface per time [1/s].
        probability: (G, I) to come from each interface to the next, the last to an escape; NaN behind it.
        rate: (G) of escapes [1/s].
        fault: (G) whether the state of a path was no longer physical: such a run counts for nothing.
        latest: Largest clock of a path [time steps].
        steps: (G) world-steps.
    """

    flux: np.ndarray
    probability: np.ndarray
    rate: np.ndarray
    fault: np.ndarray
    steps: np.ndarray
    latest: int


@dataclass(eq=False)
class Runs:
    """Runs on their way: states at their present interface.

    Attributes:
        pools: Per run.
        flux, fault, looks: As in `Estimates`, of (G) runs so far.
        low: (G) ends of their basins.
        latest: Largest clock of a path [time steps].
    """

    pools: list[States]
    flux: np.ndarray
    fault: np.ndarray
    looks: np.ndarray
    low: np.ndarray
    latest: int = 0

    @classmethod
    def out_of_the_basin(cls, ensemble: Ensemble, layout: Layout, places: list[Placement], window: int | None) -> Runs:
        """Count the flux of all runs."""
        m = layout.branches
        per = {
            "basin": [p.basin for p in places],
            "first": [p.interfaces[0] for p in places],
            "relax": [p.relax for p in places],
            "looks": [p.looks for p in places],
        }
        found = flux(ensemble, layout.of_life, window=window, **{k: np.repeat(v, m) for k, v in per.items()})
        every = ensemble.every * ensemble.sim.time_step
        pools, rates = [], np.zeros(len(places))
        for g in range(len(places)):
            states, looks = found.of(g * m, (g + 1) * m)
            pools.append(states)
            rates[g] = len(states) / (looks * every)
        looks = np.array([(p.looks + p.relax) * m for p in places])
        return cls(pools, rates, np.zeros(len(places), bool), looks, np.array(per["basin"]))

    def count(self, runs: np.ndarray, paths: Paths) -> None:
        """Keep the books of paths; `runs` (n) says whose they are."""
        np.add.at(self.looks, runs, paths.looks)
        np.logical_or.at(self.fault, runs, paths.code == FAULT)
        self.latest = max(self.latest, int(paths.states.clock.max(initial=0)))

    def estimates(self, ensemble: Ensemble, probability: np.ndarray) -> Estimates:
        """What they have found."""
        product = np.prod(np.where(np.isnan(probability), 1.0, probability), axis=-1)
        return Estimates(
            flux=self.flux,
            probability=probability,
            rate=self.flux * product,
            fault=self.fault,
            steps=self.looks * ensemble.every,
            latest=self.latest,
        )


def forward_flux(
    ensemble: Ensemble, layout: Layout, places: list[Placement], *, window: int | None = None
) -> Estimates:
    """Estimate the rates of escape of runs, side by side.

    Args:
        ensemble: Its worlds have the parameters of the runs that the layout gives them to.
        layout: Which run has which worlds.
        places: Of each run.
        window: See `flux`.
    """
    m = layout.branches
    runs = Runs.out_of_the_basin(ensemble, layout, places, window)
    probability = np.full((len(places), MOST), np.nan)
    for stage in range(max(len(p.interfaces) for p in places)):
        there = [g for g, p in enumerate(places) if stage < len(p.interfaces)]
        probability[there, stage] = 0.0
        active = [g for g in there if len(runs.pools[g])]
        if not active:
            continue
        worlds = np.concatenate([layout.worlds(g) for g in active])
        begun = [runs.pools[g][spread(len(runs.pools[g]), m, layout.random(g, stage))] for g in active]
        low, high = (np.repeat(v, m) for v in (runs.low[active], [_after(places[g], stage) for g in active]))
        paths = ensemble.run(worlds, States.joined(begun), layout.of_stage(worlds, stage), low, high)
        runs.count(worlds // m, paths)
        success = (paths.code == UP) | (paths.code == LOST)
        for n, g in enumerate(active):
            mine = np.arange(n * m, (n + 1) * m)
            probability[g, stage] = np.mean(success[mine])
            runs.pools[g] = paths.states[mine[success[mine]]]
    return runs.estimates(ensemble, probability)


def _after(place: Placement, stage: int) -> float:
    """The interface behind one; behind the last there is only the escape."""
    return float(place.interfaces[stage + 1]) if stage + 1 < len(place.interfaces) else np.inf
