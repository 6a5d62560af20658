"""The shipped numbers are functions of what they name; `test_observations.py` runs some."""

import inspect

import pytest

import otwarp.studies
from otwarp.kernels.drivers import numbers


@pytest.mark.parametrize("name", ["contact_force", "orientation_error"])
def test_each_is_offered_with_its_parameters(name):
    function, made = getattr(numbers, name), getattr(otwarp.studies, name)
    assert made().function.function is function
    assert len(made().values) == len(inspect.signature(function).parameters) - 1
