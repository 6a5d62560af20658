"""Looks at numbers of trials that are fixed beforehand: what they may miss in all, and how narrow the last is."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.studies.stopping.contour import contour
from otwarp.studies.stopping.intervals import interval
from otwarp.studies.stopping.looks import doubling, level_at, looks_for
from otwarp.studies.stopping.rules import half_width, trials


@pytest.mark.parametrize(("first", "last"), [(16, 16), (16, 20), (16, 3_221), (64, 16_384), (1, 3)])
def test_what_looks_may_miss_is_shared_out(first, last):
    """All of 5 %, in proportion to the trials since the look before; numbers rise by factors of √2 to 2√2."""
    looks = np.array(doubling(first, last))
    assert looks[-1] == last and looks[0] in (first, last)
    assert len(looks) == 1 or np.all((looks[1:] / looks[:-1] > 1.3) & (looks[1:] / looks[:-1] < 3.01))
    miss = 1.0 - level_at(looks, 0.95, looks)
    assert np.sum(miss) == pytest.approx(0.05, rel=1e-12)
    assert miss == pytest.approx(0.05 * np.diff(looks, prepend=0) / last, rel=1e-9)


@pytest.mark.parametrize("p", [0.02, 0.3, 0.5, 0.93])
def test_all_looks_together_hold_what_one_says(p):
    """Whoever stops at the worst look there is misses 10 % at most, of 4,000 points, at 5σ (0.024)."""
    count, looks = 4_000, np.array(doubling(16, 2_048))
    new = np.diff(looks, prepend=0)
    sums = np.cumsum(np.random.Generator(np.random.Philox(5)).binomial(new, p, (count, len(looks))), axis=1)
    low, high = interval(sums, looks, level=level_at(looks, 0.9, looks))
    assert np.mean(np.any((p < low) | (p > high), axis=1)) <= 0.1 + 5.0 * np.sqrt(0.09 / count)


@pytest.mark.parametrize(("levels", "width"), [((0.5,), 0.05), ((0.95,), 0.02), ((0.1, 0.4), 0.03)])
def test_the_last_look_is_the_first_that_is_narrow(levels, width):
    """Of every count there the interval is as narrow as wanted or holds no level; with 3 % fewer trials not."""
    looks = looks_for(levels, width, 0.95, 16, 16_384)

    def widest(looks: tuple[int, ...]) -> float:
        """Half-width of the widest interval of the last look that holds a level."""
        n = looks[-1]
        low, high = interval(np.arange(n + 1), n, level=level_at(looks, 0.95, np.array(n)))
        return max(0.5 * float(np.max(np.where((low <= p) & (p <= high), high - low, 0.0))) for p in levels)

    assert widest(looks) <= width < widest(doubling(16, int(0.97 * looks[-1])))
    assert looks_for(levels, width, 0.95, 16, 100) == doubling(16, 100)


@pytest.mark.parametrize(
    ("rule", "reached"),
    [
        (half_width(0.05), None),
        (half_width(0.05, at_most=100), 0.1017),
        (contour(0.5, half_width=0.02), None),
        (contour(0.95, half_width=0.02, at_most=100), 0.0552),
        (trials(9), None),
    ],
    ids=str,
)
def test_a_rule_says_what_it_cannot_reach(rule, reached):
    """Half-widths with the most trials there may be, as `otwarp study plan` says them."""
    assert rule.reached() == (None if reached is None else pytest.approx(reached, abs=1e-4))


def test_a_point_goes_from_look_to_look():
    """To the next while it may be on either side; `at_most` is the last, and a store says all of them."""
    rule = contour(0.5, half_width=0.05)
    assert rule.at_least == rule.looks[0] == 16 and rule.at_most == rule.looks[-1] < 600
    done = np.array([0, 16, 16, 32, rule.at_most])
    assert rule.wanted(np.array([[0, 0, 8, 16, 260]]), done).tolist() == [16, 16, 32, 64, rule.at_most]
    with pytest.raises(InputError, match="method is 'clopper-pearson'; allowed: looks, sequence"):
        contour(0.5, method="clopper-pearson")  # type: ignore[arg-type]
    assert rule.said()["looks"] == rule.looks and "looks" not in contour(0.5, method="sequence").said()
