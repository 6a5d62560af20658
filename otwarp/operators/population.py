"""Who the SIMULATED operators are: distributions of every number of the model, read from one committed file.

The file was committed before the first delivery trial, and nothing in it was fitted to an outcome; its SHA-256 goes
with every result.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError

KINDS = ("uniform", "lognormal", "normal")
"""Distributions that a parameter may have."""
BASES = ("source", "spread", "assumed")
"""Where a distribution is from: a source has it, a source has its middle, nobody has it."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number that differs from one simulated operator to the next.

    Attributes:
        name: Of its table in the file.
        meaning, unit: For people.
        distribution: A name of `KINDS`.
        low, high: Least and largest value.
        middle, spread: Median and deviation of the logarithm, or mean and deviation; of a uniform one 0.
        basis: A name of `BASES`.
        source: Who says so; "" for nobody.
    """

    name: str
    meaning: str
    unit: str
    distribution: str
    low: float
    high: float
    middle: float = 0.0
    spread: float = 0.0
    basis: str = "assumed"
    source: str = ""

    def at(self, share: ArrayLike) -> np.ndarray:
        """Values below which this share of the operators is, 0 to 1: the inverse of the distribution function."""
        from scipy.special import ndtr, ndtri

        u = np.asarray(share, dtype=float)
        if self.distribution == "uniform":
            return self.low + u * (self.high - self.low)
        if self.distribution == "lognormal":
            low, high, middle = np.log(self.low), np.log(self.high), np.log(self.middle)
        else:
            low, high, middle = self.low, self.high, self.middle
        ends = ndtr((low - middle) / self.spread), ndtr((high - middle) / self.spread)
        value = np.clip(middle + self.spread * ndtri(ends[0] + u * (ends[1] - ends[0])), low, high)
        return np.exp(value) if self.distribution == "lognormal" else value


@dataclass(frozen=True, kw_only=True)
class Population:
    """All parameters of simulated operators.

    Attributes:
        parameters: What differs from one operator to the next, in the order of the file.
        fixed: What does not: numbers, or lists of numbers.
        sha256: Of the file.
        text: The file, byte for byte.
    """

    parameters: tuple[Parameter, ...]
    fixed: Mapping[str, Any]
    sha256: str
    text: bytes

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return tuple(p.name for p in self.parameters)

    def draw(self, seed: int, operators: ArrayLike) -> np.ndarray:
        """(n, parameters) of operators by their numbers: an operator is the same whoever else is drawn.

        Args:
            seed: Key of the random numbers.
            operators: (n) numbers from 0 on.
        """
        keys = np.asarray(operators, dtype=np.uint64)
        shares = [np.random.Generator(np.random.Philox(key=[seed, key])).random(len(self.parameters)) for key in keys]
        return self.at(np.array(shares).reshape(len(keys), len(self.parameters)))

    def at(self, shares: np.ndarray) -> np.ndarray:
        """(n, parameters) for (n, parameters) shares, see `Parameter.at`."""
        columns = [p.at(shares[:, i]) for i, p in enumerate(self.parameters)]
        return np.stack(columns, axis=1)

    def middle(self) -> np.ndarray:
        """(parameters) of the operator in the middle of every distribution."""
        return self.at(np.full((1, len(self.parameters)), 0.5))[0]


def load_population() -> Population:
    """The population that comes with the package.

    Raises:
        InputError: The installed file is not as this version reads it.
    """
    return read_population((files("otwarp.operators") / "population.toml").read_bytes())


def read_population(text: bytes) -> Population:
    """A population from the bytes of its file.

    Raises:
        InputError: It is no such file; one line.
    """
    try:
        said = tomllib.loads(text.decode("utf-8"))
        parameters = tuple(_parameter(name, row) for name, row in said["parameters"].items())
        fixed = said["fixed"]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"population: cannot be read ({error}); allowed: a file like population.toml") from None
    if said.get("version") != 1:
        raise InputError(f"population: version = {said.get('version')!r}: must be 1")
    return Population(parameters=parameters, fixed=fixed, sha256=hashlib.sha256(text).hexdigest(), text=text)


def _parameter(name: str, row: Mapping[str, Any]) -> Parameter:
    """One table of the file.

    Raises:
        InputError: A distribution that is none.
        KeyError: A number is missing.
    """
    kind, basis = row["distribution"], row["basis"]
    if kind not in KINDS or basis not in BASES:
        raise InputError(f"population: {name} is {kind!r}, {basis!r}; allowed: {', '.join(KINDS)}; {', '.join(BASES)}")
    middle, spread = {"uniform": (None, None), "lognormal": ("median", "spread"), "normal": ("mean", "deviation")}[kind]
    found = Parameter(
        name=name,
        meaning=row["meaning"],
        unit=row["unit"],
        distribution=kind,
        low=float(row["low"]),
        high=float(row["high"]),
        middle=float(row[middle]) if middle else 0.0,
        spread=float(row[spread]) if spread else 0.0,
        basis=basis,
        source=" ".join(row.get("source", "").split()),
    )
    if not found.low < found.high or (spread and not found.spread > 0.0):
        raise InputError(f"population: {name} is from {found.low:g} to {found.high:g}, spread {found.spread:g}; "
                         "allowed: low below high, a spread above 0")  # fmt: skip
    return found
