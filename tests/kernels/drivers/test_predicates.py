"""The shipped ends are functions of what they name; `tests/simulation/test_episodes.py` runs them."""

import inspect

import pytest

import otwarp as ot
from otwarp.kernels.drivers import predicates


@pytest.mark.parametrize("name", ["escaped", "reached", "strayed", "timed_out"])
def test_each_is_offered_with_its_parameters(name):
    function, made = getattr(predicates, name), getattr(ot, name)
    assert made.predicate.function is function
    assert list(made.values) == list(inspect.signature(function).parameters)[1:]
