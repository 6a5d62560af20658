"""Functions from outside the package: their source, what decides their results, and their float64 twins."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.functions import doubled_function, full_source, function_from_text, source_of

TENTH = 0.1


@wp.func
def third(x: float) -> float:
    return x / 3.0


def scaled(x: float) -> float:
    return TENTH * third(x)


def test_a_function_from_text_works_and_shows_its_source():
    made = function_from_text("twice", "def twice(x):\n    return 2 * x\n", {})
    assert made(21) == 42
    assert inspect.getsource(made) == "def twice(x):\n    return 2 * x\n"


def test_source_is_the_definition_alone():
    def inner(function):
        return function

    @inner
    def kept(x):
        # a comment does not count
        return x + 1

    assert source_of(kept) == "def kept(x):\n    return x + 1"
    with pytest.raises(InputError, match="source cannot be read"):
        source_of(eval("lambda x: x"))


def test_constants_and_called_functions_decide_results():
    text = full_source(scaled)
    assert f"TENTH = {TENTH!r}" in text
    assert "return x / 3.0" in text


class Unknown:
    pass


THING = Unknown()


def uses_a_thing(x: float) -> float:
    return x if THING else 2.0 * x


def test_what_cannot_be_told_from_another_is_refused():
    with pytest.raises(InputError, match="uses_a_thing uses THING, a Unknown"):
        full_source(uses_a_thing)


def test_the_twin_of_a_function_calculates_in_float64(device):
    twin = doubled_function(scaled)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(x: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        out[wp.tid()] = twin(x[wp.tid()])

    x = np.linspace(-2.0, 2.0, 17)
    out = wp.zeros(len(x), dtype=wp.float64, device=device)
    wp.launch(probe, dim=len(x), inputs=[wp.array(x, dtype=wp.float64, device=device), out], device=device)
    np.testing.assert_allclose(out.numpy(), TENTH * (x / 3.0), rtol=1e-15)
