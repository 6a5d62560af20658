"""Paths within the basin: when they have forgotten their start, and how often they leave it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.rare.ensemble import FAULT, GONE_BACK, LOST, UP, Ensemble
from otwarp.studies.rare.states import States

LIVES = 64
"""Times that a world may begin anew with noise of its own."""

RELAXATIONS = 3.0
"""Fastest relaxation times after which distributions are compared for the first time: a start that is as far from the
equilibrium as a bead usually is would not be told from it before."""

LONGEST = 2**16
"""Looks within which order parameters settle where nobody says when."""

KOLMOGOROV = 1.36
"""Distance of two distributions of n samples each, over √(2/n), that is exceeded by chance once in 20 times."""


Numbers = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(worlds, lives) → numbers of the trials whose noise they have; lives count from 0."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Crossings:
    """How often paths have left their basins.

    Attributes:
        worlds: (n) which world it was, in the order of time, then of worlds.
        states: (n) the first state at the first interface or beyond, or lost.
        looks: (W) looks that each world was counted for.
    """

    worlds: np.ndarray
    states: States
    looks: np.ndarray

    def of(self, first: int, last: int) -> tuple[States, int]:
        """Crossings and looks of the worlds from `first` up to but not including `last`."""
        mine = np.flatnonzero((self.worlds >= first) & (self.worlds < last))
        return self.states[mine], int(self.looks[first:last].sum())


def flux(
    ensemble: Ensemble,
    number_of: Numbers,
    *,
    basin: np.ndarray,
    first: np.ndarray,
    relax: np.ndarray,
    looks: np.ndarray,
    window: int | None = None,
) -> Crossings:
    """Count how often worlds cross their first interface for the first time after they were in their basin.

    A world starts as the scene does, and again when it has lost its sphere: in the steady state that this makes, the
    mean time between losses is the mean time from that start to a loss (Hill 1989, Free Energy Transduction and
    Biochemical Cycle Kinetics). A loss in the same look as a crossing is both.

    Args:
        ensemble: Its worlds, all of them.
        number_of: Which noise a world has.
        basin, first: (W) a world is in its basin below the one, and has left it at the other or above.
        relax: (W) looks before anything counts.
        looks: (W) looks that count.
        window: Looks of a life, where the clock matters because traps or obstacles move; None: one life goes on.
    """
    w = ensemble.worlds
    everyone = np.arange(w)
    inside, life, age, counted = np.ones(w, bool), np.zeros(w, int), np.zeros(w, int), np.zeros(w, int)
    which: list[np.ndarray] = []
    kept: list[States] = []
    ensemble.start(everyone, number_of(everyone, life))
    _aim(ensemble, everyone, inside, basin, first)
    running = counted < looks
    ensemble.rest(np.flatnonzero(~running))
    while np.any(running):
        done = ensemble.look().copy()
        age += running
        counts = running & (age > relax)
        counted += counts
        lost, up, back = (running & (done == code) for code in (LOST, UP, GONE_BACK))
        crossed = np.flatnonzero(counts & inside & (lost | up))
        if len(crossed):
            which.append(crossed)
            kept.append(ensemble.states(crossed))
        inside[up], inside[back] = False, True
        anew = lost | (running & (done == FAULT))
        if window is not None:
            anew |= running & (age >= window)
            age[anew] = 0
        if np.any(anew):
            _start_again(ensemble, np.flatnonzero(anew), life, number_of, window)
            _check_lives(life, window)
            inside[anew] = True
        over = running & (counted >= looks)
        running &= ~over
        turned = np.flatnonzero(running & (up | back | anew))
        if len(turned):
            _aim(ensemble, turned, inside, basin, first)
        ensemble.rest(np.flatnonzero(over))
    states = States.joined(kept) if kept else ensemble.states(everyone[:0])
    return Crossings(worlds=np.concatenate([everyone[:0], *which]), states=states, looks=counted)


def _aim(ensemble: Ensemble, worlds: np.ndarray, inside: np.ndarray, basin: np.ndarray, first: np.ndarray) -> None:
    """Give worlds an interface: the first one to those in their basin, the end of the basin to the others."""
    home = inside[worlds]
    ensemble.between(worlds, np.where(home, -np.inf, basin[worlds]), np.where(home, first[worlds], np.inf))


def _start_again(
    ensemble: Ensemble, worlds: np.ndarray, life: np.ndarray, number_of: Numbers, window: int | None
) -> None:
    """Start worlds in their next lives; their clocks go on where they do not matter."""
    life[worlds] += 1
    clock = None if window is not None else ensemble.clock(worlds)
    ensemble.start(worlds, number_of(worlds, life[worlds] % LIVES), clock)


def _check_lives(life: np.ndarray, window: int | None) -> None:
    """Refuse worlds whose noise would begin to repeat where each life starts at the same clock."""
    if window is not None and life.max() >= LIVES:
        raise InputError(f"a world escapes {LIVES} times while the flux is counted; allowed: a deeper trap, "
                         "or a study of first passages")  # fmt: skip


def settled(
    ensemble: Ensemble, number_of: Numbers, per: int, *, window: int | None = None, known: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """After how many looks the order parameter is distributed as later on, and how.

    The distributions after t, 2 t and 4 t looks are told apart by the test of Kolmogorov and Smirnov at 5 %; t doubles
    until they are not.

    Args:
        ensemble: Its worlds; each `per` of them, one after the other, are of one point.
        number_of: As for `flux`.
        per: Worlds of a point.
        window: Likewise; half of it is the longest that is waited for.
        known: Whether the user has said how long it takes: what is seen last will do then.

    Returns:
        (G) looks: twice that time; (G, 3 per) samples, sorted; (G) medians at the first look.

    Raises:
        InputError: It goes on changing.
    """
    w, longest = ensemble.worlds, LONGEST if window is None else window // 2
    everyone, life = np.arange(w), np.zeros(w, dtype=int)
    ensemble.start(everyone, number_of(everyone, life))
    ensemble.between(everyone, -np.inf, np.inf)
    groups = w // per
    relax, samples = np.zeros(groups, dtype=int), np.zeros((groups, 3 * per))
    taken: list[np.ndarray] = []
    t, at = 0, max(1, int(np.ceil(RELAXATIONS * ensemble.slowness)))
    begun = np.zeros(groups)
    limit = KOLMOGOROV * np.sqrt(2.0 / per)
    while np.any(relax == 0):
        if at > longest and known and len(taken) >= 3:
            for g in np.flatnonzero(relax == 0):
                relax[g], samples[g] = t // 2, np.sort(np.concatenate([rows[g] for rows in taken[-3:]]))
            break
        if at > longest:
            raise InputError(f"order {ensemble.order.name} has not settled after {t} looks; "
                             "allowed: relax=…, the time after which it has")  # fmt: skip
        while t < at:
            done = ensemble.look()
            if t == 0:
                begun = np.nanmedian(ensemble.orders(everyone).reshape(groups, per), axis=-1)
            again = np.flatnonzero((done == LOST) | (done == FAULT))
            if len(again):
                _start_again(ensemble, again, life, number_of, window)
                ensemble.between(again, -np.inf, np.inf)
            t += 1
        # who was lost before he was looked at counts as far away
        taken.append(np.sort(np.nan_to_num(ensemble.orders(everyone), nan=np.inf).reshape(groups, per), axis=-1))
        at *= 2
        if len(taken) < 3:
            continue
        for g in np.flatnonzero(relax == 0):
            one, two, three = (rows[g] for rows in taken[-3:])
            if max(_apart(one, two), _apart(two, three), _apart(one, three)) < limit:
                relax[g] = t // 2
                samples[g] = np.sort(np.concatenate([one, two, three]))
    ensemble.rest(everyone)
    return relax, samples, begun


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of two empirical distributions of sorted samples."""
    both = np.concatenate([a, b])
    return float(np.abs(np.searchsorted(a, both, "right") / len(a) - np.searchsorted(b, both, "right") / len(b)).max())
