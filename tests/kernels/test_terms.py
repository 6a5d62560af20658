"""Terms of a step, and why each is in or out."""

import dataclasses

import pytest

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.noise import NOISES
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.terms import terms
from tests.kernels.skip_cases import CASES, NUMBERS


def test_every_term_says_why():
    f = Features(brownian=False)
    rows = terms(f)
    assert len({name for name, _, _ in rows}) == len(rows)
    assert all(why for _, _, why in rows)
    assert [name for name, on, _ in rows if on] == ["lone-sphere mobility"]


def test_a_term_follows_from_its_feature():
    f = Features(brownian=False)
    more = dataclasses.replace(f, brownian=True, gravity=True, traps=1, trap_models=("harmonic_isotropic",))
    new = {name: why for (name, on, why), (_, before, _) in zip(terms(more), terms(f), strict=True) if on != before}
    assert new == {
        "harmonic trap": "a trap uses it",
        "Brownian noise": "ot:scene:brownian and temperature > 0",
        "gravity": "ot:scene:gravity",
    }


def switched(name: str) -> set[object]:
    """Values of a feature that some case of the skip table has with its term and not without it."""
    values: set[object] = set()
    for with_, without, _ in CASES.values():
        there, gone = getattr(with_, name), getattr(without, name)
        if isinstance(there, tuple):
            values |= set(there) - set(gone)
        elif there != gone:
            values.add(there)
    return values


@pytest.mark.parametrize("name", [f.name for f in dataclasses.fields(Features) if f.name not in NUMBERS])
def test_every_feature_has_a_case_in_the_skip_table(name):
    """A new feature without one fails: add functions that only it needs to `skip_cases`."""
    assert switched(name)


@pytest.mark.parametrize(
    ("name", "values"),
    [("flow", FLOW_TERMS), ("obstacles", SHAPES), ("noise", NOISES), ("integrator", INTEGRATORS), ("walls", (1, 2))],
)
def test_every_kind_has_a_case_in_the_skip_table(name, values):
    assert set(values) <= switched(name)


def test_what_is_no_term_is_a_feature():
    assert set(NUMBERS) <= {f.name for f in dataclasses.fields(Features)}
    assert all(names for _, _, names in CASES.values())
