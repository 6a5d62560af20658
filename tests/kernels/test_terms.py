"""Terms of a step, and why each is in or out."""

import dataclasses

from otwarp.kernels.core.features import Features
from otwarp.kernels.terms import terms


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
