"""The committed population: frozen, sourced, and drawn alike wherever an operator is drawn."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import otwarp.operators
from otwarp.errors import InputError
from otwarp.operators.population import load_population, read_population

FROZEN = "9f50557aeda097e9997c6426fba9e734afaa370df1d8e646779ab4787f2e71ba"
"""SHA-256 of the file as it was committed before the first delivery trial."""


@pytest.fixture(scope="module")
def population():
    return load_population()


def test_it_is_the_file_that_was_frozen(population):
    assert population.sha256 == FROZEN


def test_every_distribution_has_a_source_or_says_that_it_is_assumed(population):
    assert len(population.parameters) == 18
    for parameter in population.parameters:
        assert parameter.meaning and parameter.unit
        assert parameter.source or parameter.basis == "assumed", parameter.name


def test_draws_follow_the_distributions(population):
    """Kolmogorov–Smirnov at the probability of 5σ, 2,000 operators, seed 1."""
    drawn = population.draw(1, np.arange(2000))
    for i, p in enumerate(population.parameters):
        if p.distribution == "uniform":
            reference = stats.uniform(p.low, p.high - p.low)
            row = drawn[:, i]
        else:
            ends = (p.low, p.high) if p.distribution == "normal" else (np.log(p.low), np.log(p.high))
            middle = p.middle if p.distribution == "normal" else np.log(p.middle)
            low, high = ((end - middle) / p.spread for end in ends)
            reference = stats.truncnorm(low, high, middle, p.spread)
            row = drawn[:, i] if p.distribution == "normal" else np.log(drawn[:, i])
        assert np.all((drawn[:, i] >= p.low) & (drawn[:, i] <= p.high)), p.name
        assert stats.kstest(row, reference.cdf).pvalue > 5.7e-7, p.name


def test_an_operator_is_the_same_whoever_else_is_drawn(population):
    everyone = population.draw(3, np.arange(10))
    np.testing.assert_array_equal(population.draw(3, [7, 2]), everyone[[7, 2]])
    assert np.any(population.draw(4, [7]) != everyone[7])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"version = 1", b"version = 2", "version = 2"),
        (b'"uniform"\nlow', b'"round"\nlow', "'round'"),
        (b"low = 0.15", b"low = 0.35", "low below high"),
        (b"low = 0.15\n", b"", "'low'"),
        (b"[fixed]", b"[fixed", "cannot be read"),
    ],
)
def test_a_file_that_is_none_is_refused(population, old, new, said):
    with pytest.raises(InputError, match="population") as error:
        read_population(population.text.replace(old, new, 1))
    assert said in str(error.value)


def test_whoever_speaks_of_an_operator_calls_it_simulated():
    """In every file of the room; names of modules in imports are no speech."""
    files = sorted(Path(otwarp.operators.__file__).parent.rglob("*.py"))
    assert len(files) > 30
    for file in files:
        lines = [line for line in file.read_text(encoding="utf-8").lower().splitlines() if "import" not in line]
        spoken = [line.replace("otwarp.operators", "").replace("teleop.operators", "") for line in lines]
        if any("operator" in line for line in spoken):
            assert any("simulated" in line for line in spoken), file
