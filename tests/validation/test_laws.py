"""The comparison itself: it passes what it should, fails what it should, and the page shows what it recorded."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.validation import BEGIN, END, Collector, figures, grouped, put_on_page
from otwarp.errors import InputError
from tests.validation.laws import Law, across_worlds, lagged


@pytest.fixture
def rows() -> list[dict]:
    return []


@pytest.fixture
def compare(rows) -> Law:
    return Law(lambda name, value: rows.append(json.loads(str(value))))


def test_five_standard_errors_and_the_bias_are_allowed(compare, rows):
    compare("x", [1.0, 1.049], 1.0, 0.01)
    compare("x", 1.079, 1.0, 0.01, bias=0.03)
    for measured, bias in ((1.051, 0.0), (0.949, 0.0), (1.081, 0.03), (np.nan, 0.03)):
        with pytest.raises(AssertionError):
            compare("x", measured, 1.0, 0.01, bias=bias)
    assert rows[0]["sigmas"] == pytest.approx(4.9)
    assert rows[0]["count"] == 2


def test_one_wrong_element_of_a_tensor_fails(compare):
    good = np.eye(3)
    compare.tensor("t", good, np.eye(3), 0.1)
    for place in ((1, 1), (0, 2)):
        bad = good.copy()
        bad[place] += 0.6
        with pytest.raises(AssertionError):
            compare.tensor("t", bad, np.eye(3), 0.1)


def test_chi_square_sees_other_probabilities(compare):
    rng = np.random.default_rng(1)
    counts = np.histogram(rng.uniform(size=20_000), 20, (0.0, 1.0))[0]
    compare.chi_square("u", counts, np.full(20, 0.05))
    tilted = np.linspace(0.9, 1.1, 20) * 0.05
    with pytest.raises(AssertionError):
        compare.chi_square("u", counts, tilted)
    with pytest.raises(AssertionError, match="too small"):
        compare.chi_square("u", counts[:2] // 5000, np.full(2, 0.5))


def test_statistics_of_worlds():
    rng = np.random.default_rng(2)
    mean, error = across_worlds(rng.standard_normal((4000, 2)) * [1.0, 3.0])
    np.testing.assert_allclose(error, np.array([1.0, 3.0]) / np.sqrt(4000), rtol=0.1)
    assert np.all(np.abs(mean) < 5.0 * error)
    a = np.array([[[1.0]], [[2.0]], [[3.0]]])
    b = np.array([[[10.0]], [[20.0]], [[30.0]]])
    # a(t) b(t + 1): (1·20 + 2·30)/2
    assert lagged(a, b, 1)[0, 0, 0] == 40.0


def test_the_page_takes_the_tables_between_its_markers(compare, rows):
    compare("|x|", [1.0, 1.02], 1.0, 0.01)
    assert figures(rows[0]) == ("\\|x\\| (worst of 2)", "1", "0.01", "–", "1.02", "+2.00")
    page = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    assert put_on_page(page, "new") == f"before\n{BEGIN}\nnew\n{END}\nafter\n"
    with pytest.raises(InputError, match="markers"):
        put_on_page("no markers", "new")


def test_the_precise_test_stands_for_the_quick_one(compare, rows):
    compare("x", 1.0, 1.0, 0.01)
    tests = ("t.py::test_a", "t.py::test_a_precisely[1]", "t.py::test_a_precisely[2]", "t.py::test_b")
    found = Collector(rows=dict.fromkeys(tests, rows))
    assert grouped(found) == {("t.py", "test_a_precisely"): list(tests[1:3]), ("t.py", "test_b"): [tests[3]]}
