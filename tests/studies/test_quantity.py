"""Units: read, converted, refused."""

from __future__ import annotations

import pytest

from otwarp.errors import InputError
from otwarp.studies.quantity import quantity, ratio, unit_of
from otwarp.units import INTERNAL_SYMBOL, SI_SYMBOL


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5 mW", "mW", 5.0),
        ("0.1 um", "µm", 0.1),
        ("100nm", "µm", 0.1),
        ("2e-5 N/m", "pN/µm", 20.0),
        ("1 mPa·s", "Pa·s", 0.001),
        ("2 min", "s", 120.0),
        ("60 Hz", "1/s", 60.0),
        ("997 kg/m^3", "kg/m³", 997.0),
        ("5 %", "", 0.05),
        ("-3", "", -3.0),
    ],
)
def test_quantities(text, unit, value):
    """Prefixes, exponents, products and quotients; powers of ten leave no rounding."""
    assert quantity(text, unit, "x") == pytest.approx(value, rel=1e-15)


def test_units_of_parameters():
    """Every unit in which otwarp states a parameter can be written in a study."""
    for symbol in (*INTERNAL_SYMBOL.values(), *SI_SYMBOL.values(), "pN/µm per mW", "pN·µm² per mW", "pN per mW"):
        assert ratio(symbol, symbol, "x") == 1.0
    assert ratio("pN/nm per W", "pN/µm per mW", "x") == 1.0
    assert unit_of("mW").powers == unit_of("pN·m/s").powers


@pytest.mark.parametrize(
    ("given", "unit", "said"),
    [
        ("5 kg", "mW", "x has the unit 'kg'; allowed: mW"),
        ("5", "mW", "without a unit"),
        (5.0, "mW", "without a unit"),
        ("five mW", "mW", "allowed: a number with its unit"),
        ("5 mWatt", "mW", "has the symbol 'mWatt'"),
        ("inf s", "s", "allowed: a number"),
        (True, "", "allowed: a number"),
        ("1e999 s", "s", "finite"),
    ],
)
def test_refused(given, unit, said):
    """One line that names what, the value and what is allowed."""
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        quantity(given, unit, "x")
