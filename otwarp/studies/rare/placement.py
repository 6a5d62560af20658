"""Where interfaces are put: by pilot runs whose paths count for nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.rare.basin import flux, settled
from otwarp.studies.rare.ensemble import LOST, UP, Ensemble
from otwarp.studies.rare.layout import Layout, spread
from otwarp.studies.rare.states import States

HOME, AWAY = 0.5, 0.9
"""Shares of the time that a world is below the end of its basin, and below its first interface."""

CROSSINGS = 2
"""Crossings of the first interface by each world of a run, about."""

PATIENCE = 6
"""Doublings of the time in which the first interface must be crossed."""

MOST = 64
"""Interfaces at most."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement:
    """What the runs of a point need to know.

    Attributes:
        basin: End of the basin.
        interfaces: (I) order parameters; behind the last comes the escape.
        relax: Looks until paths have forgotten their start.
        looks: Looks over which each world of a run is counted in the basin.
        found: Whether a path of the pilot has come to an escape.
    """

    basin: float
    interfaces: np.ndarray
    relax: int
    looks: int
    found: bool = True


def rounded(values: np.ndarray | float) -> np.ndarray:
    """Values as the device compares them."""
    return np.asarray(values, dtype=np.float32).astype(float)


def place(
    ensemble: Ensemble,
    layout: Layout,
    *,
    crossing: float,
    interfaces: np.ndarray | None = None,
    basin: float | None = None,
    relax: int | None = None,
    window: int | None = None,
    automatic: bool = True,
) -> list[Placement]:
    """Learn of every point how it relaxes, how often it leaves its basin, and where its interfaces should be.

    An interface is put where a share `crossing` of the paths from the one before it comes to before they go back
    (exploring scouts: Kratzer, Arnold & Allen 2013, doi:10.1063/1.4792440).

    Args:
        ensemble: A run of each point.
        layout: Theirs.
        crossing: That share.
        interfaces: Given ones, (I).
        basin: Given end of the basin.
        relax: Given time to relax, in looks.
        window: See `flux`.
        automatic: Whether interfaces behind the first are wanted.

    Raises:
        InputError: The first interface is never crossed, or a start is beyond it.
    """
    groups, m = len(layout.runs), layout.branches
    found, samples, start = settled(ensemble, layout.of_life, m, window=window, known=relax is not None)
    if interfaces is not None and np.any(start >= interfaces[0]):
        raise InputError(f"the scene starts at {ensemble.order.name} = {start.max():.4g}, beyond the first interface, "
                         f"{interfaces[0]:g}; allowed: a start in the basin, or interfaces farther out")  # fmt: skip
    relaxes = found if relax is None else np.full(groups, relax)
    home = rounded(np.quantile(samples, HOME, axis=-1)) if basin is None else np.full(groups, rounded(basin))
    if interfaces is None:
        first = np.maximum(
            rounded(np.quantile(samples, AWAY, axis=-1)), np.nextafter(np.float32(home), np.float32(np.inf))
        )
    else:
        first = np.full(groups, interfaces[0])
        home = np.minimum(home, first)
    looks, pools = _pools(ensemble, layout, home, first, relaxes, window)
    steps = [[float(value)] for value in first]
    reached = np.ones(groups, dtype=bool)
    if interfaces is not None:
        steps = [list(interfaces) for _ in range(groups)]
    elif automatic:
        reached = _climb(ensemble, layout, home, steps, pools, crossing)
    return [
        Placement(
            basin=float(home[g]),
            interfaces=np.array(steps[g]),
            relax=int(relaxes[g]),
            looks=int(looks[g]),
            found=bool(reached[g]),
        )
        for g in range(groups)
    ]


def _pools(
    ensemble: Ensemble,
    layout: Layout,
    home: np.ndarray,
    first: np.ndarray,
    relax: np.ndarray,
    window: int | None,
) -> tuple[np.ndarray, list[States]]:
    """Looks that a run of each point takes in its basin, and states at its first interface."""
    groups, m = len(first), layout.branches
    looks = np.maximum(2 * relax, 8)
    pools: list[States | None] = [None] * groups
    for _ in range(PATIENCE):
        missing = np.array([pool is None for pool in pools])
        if not np.any(missing):
            break
        rest = np.where(missing, looks, 0)
        per = {"basin": home, "first": first, "relax": relax, "looks": rest}
        crossings = flux(ensemble, layout.of_life, window=window, **{k: np.repeat(v, m) for k, v in per.items()})
        for g in np.flatnonzero(missing):
            states, _ = crossings.of(int(g) * m, int(g + 1) * m)
            if len(states) * 4 < m:
                looks[g] *= 2
                continue
            pools[g] = states
            looks[g] = max(8, int(np.ceil(CROSSINGS * m * looks[g] / len(states))))
    for g, pool in enumerate(pools):
        if pool is None:
            span = looks[g] // 2 * ensemble.every * ensemble.sim.time_step
            raise InputError(
                f"the first interface, {ensemble.order.name} = {first[g]:g}, is hardly ever crossed: by less than "
                f"{m // 4} of {m} worlds within {span:.3g} s; allowed: a lower one"
            )
    return looks, [pool for pool in pools if pool is not None]


def _climb(
    ensemble: Ensemble,
    layout: Layout,
    home: np.ndarray,
    steps: list[list[float]],
    pools: list[States],
    crossing: float,
) -> np.ndarray:
    """Add interfaces to `steps` until a share `crossing` of the paths escapes; whether they did."""
    groups, m = len(pools), layout.branches
    reached = np.zeros(groups, dtype=bool)
    active = list(range(groups))
    for stage in range(0, 2 * (MOST - 1), 2):
        worlds = np.concatenate([layout.worlds(g) for g in active])
        chosen = [spread(len(pools[g]), m, layout.random(g, stage)) for g in active]
        begun = States.joined([pools[g][c] for g, c in zip(active, chosen, strict=True)])
        low = np.repeat(home[active], m)
        scouts = ensemble.run(worlds, begun, layout.of_stage(worlds, stage), low, np.inf)
        high = np.empty(len(active))
        ended = []
        for n, g in enumerate(active):
            peak = scouts.peak[n * m : (n + 1) * m]
            high[n] = rounded(np.quantile(peak, 1.0 - crossing, method="lower"))
            if np.mean(np.isinf(peak)) >= crossing:
                reached[g] = True
                ended.append(g)
            elif not high[n] > steps[g][-1]:
                # so many are beyond it already that the next is where the farther ones are
                beyond = peak[peak > steps[g][-1]]
                high[n] = float(rounded(np.min(beyond))) if len(beyond) else np.inf
                if np.isinf(high[n]):
                    ended.append(g)
                    reached[g] = len(beyond) > 0
        go = [n for n, g in enumerate(active) if g not in ended]
        if not go:
            break
        keep = np.concatenate([np.arange(n * m, (n + 1) * m) for n in go])
        bounds = np.repeat(high[go], m)
        again = ensemble.run(worlds[keep], begun[keep], layout.of_stage(worlds[keep], stage + 1), low[keep], bounds)
        following = []
        for k, n in enumerate(go):
            g, mine = active[n], slice(k * m, (k + 1) * m)
            up = np.flatnonzero((again.code[mine] == UP) | (again.code[mine] == LOST)) + k * m
            if len(up):
                steps[g].append(float(high[n]))
                pools[g] = again.states[up]
                following.append(g)
        active = following
        if not active:
            break
    return reached
