"""Adaptive multilevel splitting: the paths that came least far give way to branches of the others, again and again.

Cérou & Guyader 2007, doi:10.1080/07362990601139628. The estimate of the probability to escape before the return to the
basin has no bias, whatever the order parameter, the number of paths and the share of them that gives way (Bréhier,
Gazeau, Goudenège, Lelièvre & Rousset 2016, doi:10.1214/16-AAP1185): paths that tie go together, and a branch begins
where its parent was first seen beyond the level. That moment is found by running the parent again, with its own noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.studies.rare.ensemble import Ensemble
from otwarp.studies.rare.forward_flux import Estimates, Runs
from otwarp.studies.rare.layout import Layout, spread
from otwarp.studies.rare.placement import MOST, Placement
from otwarp.studies.rare.states import States


@dataclass(eq=False)
class Tree:
    """The living paths of a run: where each began, with which noise, and how far it came.

    Attributes:
        begun: (m) states.
        numbers: (m) of their trials.
        peak: (m) largest order parameter, infinity for those that escaped.
        share: What is left of the probability.
    """

    begun: States
    numbers: np.ndarray
    peak: np.ndarray
    share: float = 1.0

    def level(self, crossing: float) -> float:
        """The order parameter at which all but a share `crossing` give way; infinity when that share has escaped."""
        return float(np.sort(self.peak)[max(0, int((1.0 - crossing) * len(self.peak)) - 1)])

    def parents(self, level: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Which paths give way at a level, and which others they become branches of: none if nobody is beyond it."""
        gone, rest = np.flatnonzero(self.peak <= level), np.flatnonzero(self.peak > level)
        self.share *= len(rest) / len(self.peak)
        return gone, rest[random.integers(len(rest), size=len(gone))] if len(rest) else rest


def splitting(
    ensemble: Ensemble,
    layout: Layout,
    places: list[Placement],
    *,
    crossing: float,
    window: int | None = None,
) -> Estimates:
    """Estimate the rates of escape of runs, side by side; arguments as for `forward_flux`.

    Args:
        crossing: Share of the paths that goes on from a level.
    """
    runs = Runs.out_of_the_basin(ensemble, layout, places, window)
    probability = np.full((len(places), MOST), np.nan)
    probability[:, 0] = 0.0
    trees = _first(ensemble, layout, runs)
    stage = 0
    while trees:
        stage += 1
        levels = {g: tree.level(crossing) for g, tree in trees.items()}
        chosen = {}
        for g, level in levels.items():
            if np.isinf(level):
                tree = trees[g]
                probability[g, 0] = tree.share * np.mean(np.isinf(tree.peak))
                continue
            gone, parents = trees[g].parents(level, layout.random(g, stage))
            if len(parents):
                chosen[g] = gone, parents
        trees = {g: trees[g] for g in chosen}
        if trees:
            _split(ensemble, layout, runs, trees, chosen, levels, stage)
    return runs.estimates(ensemble, probability)


def _first(ensemble: Ensemble, layout: Layout, runs: Runs) -> dict[int, Tree]:
    """The first paths of every run that has left its basin."""
    m = layout.branches
    active = [g for g, pool in enumerate(runs.pools) if len(pool)]
    if not active:
        return {}
    worlds = np.concatenate([layout.worlds(g) for g in active])
    begun = [runs.pools[g][spread(len(runs.pools[g]), m, layout.random(g, 0))] for g in active]
    numbers = layout.of_stage(worlds, 0)
    paths = ensemble.run(worlds, States.joined(begun), numbers, np.repeat(runs.low[active], m), np.inf)
    runs.count(worlds // m, paths)
    trees = {}
    for n, g in enumerate(active):
        mine = slice(n * m, (n + 1) * m)
        trees[g] = Tree(begun[n], numbers[mine].copy(), paths.peak[mine].copy())
    return trees


def _split(
    ensemble: Ensemble,
    layout: Layout,
    runs: Runs,
    trees: dict[int, Tree],
    chosen: dict[int, tuple[np.ndarray, np.ndarray]],
    levels: dict[int, float],
    stage: int,
) -> None:
    """Put branches of other paths in the place of those that give way."""
    groups = list(trees)
    sizes = [len(chosen[g][0]) for g in groups]
    worlds = np.concatenate([layout.worlds(g)[chosen[g][0]] for g in groups])
    begun = States.joined([trees[g].begun[chosen[g][1]] for g in groups])
    numbers = np.concatenate([trees[g].numbers[chosen[g][1]] for g in groups])
    low = np.repeat(runs.low[groups], sizes)
    beyond = np.repeat([np.nextafter(np.float32(levels[g]), np.float32(np.inf)) for g in groups], sizes)
    parents = ensemble.run(worlds, begun, numbers, low, beyond)
    runs.count(worlds // layout.branches, parents)
    anew = layout.of_stage(worlds, stage)
    paths = ensemble.run(worlds, parents.states, anew, low, np.inf)
    runs.count(worlds // layout.branches, paths)
    first = 0
    for g, size in zip(groups, sizes, strict=True):
        mine, gone, tree = slice(first, first + size), chosen[g][0], trees[g]
        tree.begun = tree.begun.put(gone, parents.states[np.arange(first, first + size)])
        tree.numbers[gone], tree.peak[gone] = anew[mine], paths.peak[mine]
        first += size
