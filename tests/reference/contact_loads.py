"""Forces of several contacts over one step: backward Euler of the linearised contacts, solved exactly."""

from __future__ import annotations

from itertools import product

import numpy as np

SLACK = 1e-10
"""Relative violation of an inequality that is taken for rounding."""


def contact_loads(
    force: np.ndarray, stiffness: np.ndarray, floor: np.ndarray, free: np.ndarray, give: np.ndarray
) -> np.ndarray:
    """λ with λ = max(floor, F − k (free + G λ)), found by trying every set of contacts that rest on their floor.

    The solution is unique, because 1 + kG has positive principal minors.

    Args:
        force: (n,) contact forces at the start of the step [pN], n at most 12.
        stiffness: (n,) [pN/µm].
        floor: (n,) least forces [pN].
        free: (n,) opening of each gap during the step without contact [µm].
        give: (n, n) G, symmetric positive semi-definite: opening of gap i per force in contact j [µm/pN].
    """
    force, stiffness, floor, free = (np.asarray(v, dtype=float) for v in (force, stiffness, floor, free))
    n = len(force)
    slack = SLACK * (np.abs(force).max(initial=0) + np.abs(floor).max(initial=0) + 1.0)
    for pressed in product((True, False), repeat=n):
        on = np.array(pressed)
        loads = floor.copy()
        matrix = np.eye(int(on.sum())) + stiffness[on, None] * give[np.ix_(on, on)]
        known = force[on] - stiffness[on] * (free[on] + give[np.ix_(on, ~on)] @ floor[~on])
        loads[on] = np.linalg.solve(matrix, known)
        wanted = force - stiffness * (free + give @ loads)
        if np.all(loads[on] >= floor[on] - slack) and np.all(wanted[~on] <= floor[~on] + slack):
            return loads
    raise ArithmeticError("no set of contacts solves the step: G is not positive semi-definite")
