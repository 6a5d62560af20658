"""What varies in a study: grids, lists, random and quasi-random values, several names along one dimension, scatter."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.studies.quantity import quantity, ratio

Spacing = Literal["linear", "log"]


@dataclass(frozen=True, eq=False)
class Axis:
    """Values along one dimension of a study, in the unit in which they were written.

    Attributes:
        values: (n) numbers or texts, or (n, 3) vectors.
        unit: Theirs; empty for none.

    Raises:
        InputError: A unit that is no text.
    """

    values: np.ndarray
    unit: str = ""

    def __post_init__(self) -> None:
        _check_unit(self.unit)

    def __len__(self) -> int:
        return len(self.values)

    def in_unit(self, wanted: str, what: str) -> np.ndarray:
        """The values in another unit.

        Args:
            wanted: The unit, empty for pure numbers.
            what: What they are called in messages.

        Raises:
            InputError: They have a unit of another kind, or are no numbers.
        """
        if self.values.dtype.kind not in "fiu":
            raise InputError(
                f"{what} is {self.values[0].item()!r}; allowed: numbers{f' in {wanted}' if wanted else ''}"
            )
        return self.values * ratio(self.unit, wanted, what)


def values(given: ArrayLike, *, unit: str = "") -> Axis:
    """These values: numbers, vectors of three, or words such as the names of models.

    Args:
        given: (n) numbers or words, or (n, 3) vectors.
        unit: Theirs, such as `mW`; empty for pure numbers and words.

    Raises:
        InputError: None at all, another shape, a number that is not finite, or a unit that is no text.
    """
    try:
        array = np.asarray(given)
    except ValueError:  # rows of different lengths
        array = np.array([])
    if array.dtype.kind in "iu":
        array = array.astype(float)
    if array.dtype.kind not in "fUb" or array.ndim not in (1, 2) or not array.size or array.shape[1:] not in ((), (3,)):
        raise InputError(f"values are {given!r}; allowed: a list of numbers, words, or vectors of three numbers")
    if array.dtype.kind == "f" and not np.all(np.isfinite(array)):
        raise InputError(f"values hold {array[~np.isfinite(array)][0]}; allowed: finite numbers")
    return Axis(array, unit)


def grid(low: float, high: float, count: int, *, unit: str = "", spacing: Spacing = "linear") -> Axis:
    """`count` values from `low` to `high`, both included, equally far apart or by equal factors.

    Args:
        low, high: The first and the last value, in `unit`.
        count: Number of values, 2 or more.
        unit: Of the values, such as `mW`; empty for pure numbers.
        spacing: `linear`, or `log` for equal factors, from a value above 0.

    Raises:
        InputError: No such grid.
    """
    count = _count("grid", count, 2)
    if spacing not in ("linear", "log"):
        raise InputError(f"spacing of a grid is {spacing!r}; allowed: linear, log")
    a, b = _numbers(low), _numbers(high)
    if a.ndim or b.ndim or not (np.isfinite(a) and np.isfinite(b) and a < b):
        raise InputError(f"grid from {low} to {high}; allowed: finite numbers, the first of them smaller")
    if spacing == "log" and a <= 0.0:
        raise InputError(f"grid from {low} by equal factors; allowed: from a number above 0")
    return Axis(np.linspace(a, b, count) if spacing == "linear" else np.geomspace(a, b, count), unit)


def random(low: ArrayLike, high: ArrayLike, count: int, *, unit: str = "", seed: int = 0) -> Axis:
    """`count` values or vectors that are uniform between `low` and `high`, the same for the same seed.

    Args:
        low, high: Numbers or vectors of three, in `unit`.
        count: Number of values, 1 or more.
        unit: Of the values, such as `mW`; empty for pure numbers.
        seed: 0 … 2³² − 1; of names that go together each needs another one.

    Raises:
        InputError: No such range.
    """
    a, b = _box("random", low, high)
    draws = np.random.Generator(np.random.Philox(_seed("random", seed))).random((_count("random", count, 1), *a.shape))
    return Axis(a + (b - a) * draws, unit)


def normal(mean: ArrayLike, deviation: ArrayLike, count: int, *, unit: str = "", seed: int = 0) -> Axis:
    """`count` normal values or vectors, the same for the same seed: the radii of polydisperse spheres, say.

    Args:
        mean, deviation: Numbers or vectors of three, in `unit`; no deviation below 0.
        count: Number of values, 1 or more.
        unit: Of the values, such as `µm`; empty for pure numbers.
        seed: 0 … 2³² − 1; of names that go together each needs another one.

    Raises:
        InputError: A deviation that is negative, or numbers that are not finite.
    """
    m, s = _numbers(mean), _numbers(deviation)
    shaped = m.shape in ((), (3,)) and s.shape in ((), (3,))
    if not shaped or not np.all(np.isfinite(m)) or not np.all(np.isfinite(s) & (s >= 0.0)):
        raise InputError(
            f"normal with mean {mean} and deviation {deviation}; allowed: finite numbers, no deviation < 0"
        )
    m, s = np.broadcast_arrays(m, s)
    draws = np.random.Generator(np.random.Philox(_seed("normal", seed)))
    return Axis(m + s * draws.standard_normal((_count("normal", count, 1), *m.shape)), unit)


def sobol(low: ArrayLike, high: ArrayLike, count: int, *, unit: str | Sequence[str] = "", seed: int = 0) -> Any:
    """`count` points of a scrambled Sobol sequence between `low` and `high`: numbers, or vectors of three.

    With one unit for each component it is an axis for as many names, given together:
    `{("trap_power", "start.z:/World/bead"): sobol([1, -2], [9, 2], 256, unit=["mW", "µm"])}`. A power of two
    of them covers the range evenly (Sobol 1967; Owen 1998, doi:10.1006/jcom.1998.0487).

    Args:
        low, high: Numbers, vectors of three, or with several units as many numbers.
        count: Number of points, 1 or more.
        unit: Of all components, or one for each; empty for pure numbers.
        seed: Of the scrambling, 0 … 2³² − 1.

    Raises:
        InputError: No such range, or units of another number.
    """
    from scipy.stats import qmc

    a, b = _box("sobol", low, high, most=21_201)
    engine = qmc.Sobol(max(a.size, 1), rng=np.random.Generator(np.random.Philox(_seed("sobol", seed))))
    count = _count("sobol", count, 1)
    draws = engine.random_base2(math.ceil(math.log2(count)))[:count].reshape(count, *a.shape)
    points = a + (b - a) * draws
    if isinstance(unit, str | bytes) or not isinstance(unit, Sequence | np.ndarray):
        return values(points, unit=unit)
    if len(unit) != a.size:
        raise InputError(f"sobol has {a.size} components and {len(unit)} units; allowed: as many of both, or one unit")
    return tuple(Axis(points.reshape(count, -1)[:, n], each) for n, each in enumerate(unit))


@dataclass(frozen=True)
class Scatter:
    """What a number varies by from trial to trial: drawn anew for each, whatever else runs beside it.

    Draws are normal, and four deviations off at most.

    Attributes:
        deviation: Standard deviation, relative to the number if the unit is `%`.
        unit: Of the deviation.

    Raises:
        InputError: A deviation that is negative or not finite, or a unit that is no text.
    """

    deviation: float
    unit: str = "%"

    def __post_init__(self) -> None:
        _check_unit(self.unit)
        number = _numbers(self.deviation)
        if number.ndim or not (np.isfinite(number) and number >= 0.0):
            raise InputError(f"scatter has the deviation {self.deviation}; allowed: finite, 0 or more")


@dataclass(frozen=True, eq=False)
class Dimension:
    """One dimension of a study: what varies along it, together.

    Attributes:
        name: The name that it has in tables.
        columns: Name of what varies → its values, as many in each.
    """

    name: str
    columns: Mapping[str, Axis]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def dimensions(axes: Mapping[Any, Any]) -> tuple[Dimension, ...]:
    """The dimensions of a study: one for each entry, a name with an axis, or a tuple of names with one axis each.

    Raises:
        InputError: No mapping, a name twice, no axis, or axes of different lengths for names that go together.
    """
    if not isinstance(axes, Mapping):
        raise InputError(f"axes are {axes!r}; allowed: names with grid(…), values(…), … for each, as a dict")
    found: list[Dimension] = []
    for names, given in axes.items():
        names = tuple(names) if isinstance(names, tuple | list) else (names,)
        if not all(isinstance(name, str) for name in names):
            raise InputError(f"axis {names!r}; allowed: a name, or a tuple of names")
        again = next((name for name in names if names.count(name) > 1), None)
        if again is not None:
            raise InputError(f"axis {again} stands there twice; allowed: once")
        columns = (given,) if isinstance(given, Axis) else tuple(given) if isinstance(given, list | tuple) else ()
        wrong = not names or len(columns) != len(names) or not all(isinstance(c, Axis) for c in columns)
        if wrong:
            raise InputError(
                f"axis {', '.join(map(str, names))} is {given!r}; allowed: grid(…), values(…), … for each name"
            )
        if len({len(c) for c in columns}) > 1:
            lengths = ", ".join(f"{n} has {len(c)}" for n, c in zip(names, columns, strict=True))
            raise InputError(f"axes that go together have different lengths: {lengths}; allowed: the same number")
        found.append(Dimension(label(names[0]), dict(zip(names, columns, strict=True))))
    names = [name for d in found for name in d.columns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"axis {name} stands there twice; allowed: once")
    return _named_apart(found)


def label(name: str) -> str:
    """A short name for a table: start.z:/World/bead becomes start_z_bead, and /World/bead.radius bead_radius."""
    what, _, where = name.partition(":") if not name.startswith("/") else ("", "", name)
    prim, _, attribute = where.partition(".")
    parts = (what.replace(".", "_"), prim.rsplit("/", 1)[-1], attribute.rsplit(":", 1)[-1])
    return "_".join(part for part in parts if part)


def spoken(name: str) -> str:
    """The same for a picture: start.x:/World/bead becomes start x of bead, trap_power trap power."""
    what, _, where = name.partition(":") if not name.startswith("/") else ("", "", name)
    prim, _, attribute = where.partition(".")
    what = what.replace(".", " ").replace("_", " ") or attribute.rsplit(":", 1)[-1]
    owner = prim.rsplit("/", 1)[-1].replace("_", " ")
    return f"{what} of {owner}" if owner else what


def _named_apart(found: list[Dimension]) -> tuple[Dimension, ...]:
    """The same, numbered where two would have one name."""
    counts: dict[str, int] = {}
    apart = []
    for d in found:
        counts[d.name] = counts.get(d.name, 0) + 1
        apart.append(d if counts[d.name] == 1 else dataclasses.replace(d, name=f"{d.name}_{counts[d.name]}"))
    return tuple(apart)


def _check_unit(unit: Any) -> None:
    if not isinstance(unit, str):
        raise InputError(f"unit is {unit!r}; allowed: a text such as 'mW', or '' for pure numbers")


def _count(what: str, count: Any, least: int) -> int:
    if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < least:
        raise InputError(f"{what} has {count!r} values; allowed: a whole number, {least} or more")
    return int(count)


def _seed(what: str, seed: Any) -> int:
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or not 0 <= seed < 2**32:
        raise InputError(f"seed of {what} is {seed!r}; allowed: a whole number, 0 to {2**32 - 1}")
    return int(seed)


def _numbers(given: Any) -> np.ndarray:
    """Numbers as an array; NaN for what is none."""
    try:
        array = np.asarray(given)
    except (TypeError, ValueError):  # rows of unequal length
        return np.array(np.nan)
    return array.astype(float) if array.dtype.kind in "iuf" else np.array(np.nan)


def _box(what: str, low: ArrayLike, high: ArrayLike, most: int = 3) -> tuple[np.ndarray, np.ndarray]:
    a, b = _numbers(low), _numbers(high)
    shape = a.shape == b.shape and (a.shape in ((), (3,)) or (a.ndim == 1 and a.size <= most and what == "sobol"))
    if not shape or not np.all(np.isfinite(a) & np.isfinite(b) & (a < b)):
        raise InputError(
            f"{what} from {low} to {high}; allowed: finite numbers or vectors of them, each first one smaller"
        )
    return a, b


def axis_of(given: Mapping[str, Any], what: str) -> Axis:
    """An axis as a study file writes it: one of `grid`, `values`, `random`, `normal` or `sobol`, and a `unit`.

    Raises:
        InputError: Anything else.
    """
    kinds = {"grid": grid, "values": values, "random": random, "normal": normal, "sobol": sobol}
    named = [kind for kind in kinds if kind in given]
    rest = set(given) - {"name", "unit", *kinds}
    if len(named) != 1 or rest:
        extra = f", not {', '.join(sorted(rest))}" if rest else ""
        raise InputError(
            f"{what} has {', '.join(sorted(given)) or 'nothing'}; allowed: unit and one of {', '.join(kinds)}{extra}"
        )
    kind, unit = named[0], given.get("unit", "")
    wanted = "mean, deviation and count" if kind == "normal" else "from, to and count"
    try:
        if kind == "values":
            return values(given["values"], unit=unit)
        renamed = {"from": "low", "to": "high"}
        arguments: dict[str, Any] = {renamed.get(str(k), str(k)): v for k, v in dict(given[kind]).items()}
        return kinds[kind](**arguments, unit=unit)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
    except (TypeError, ValueError):
        raise InputError(f"{what}: {kind} is {given[kind]!r}; allowed: a table of {wanted}") from None


def together_of(rows: Sequence[Mapping[str, Any]]) -> list[Axis]:
    """Axes of names that go together, as a study file writes them.

    Random numbers are drawn for each name anew, and `sobol` of several names is one sequence in as many dimensions:
    with one for each, all of their points would lie on a diagonal.

    Args:
        rows: A table for each name, as for `axis_of`.

    Raises:
        InputError: Anything else, or Sobol sequences of different lengths or seeds.
    """
    own = [dict(row) for row in rows]
    for n, row in enumerate(own):
        for kind in ("random", "normal"):
            if isinstance(row.get(kind), Mapping):
                row[kind] = {"seed": n} | dict(row[kind])
    columns = [axis_of(row, f"axis {row['name']}") for row in own]
    joint = [n for n, row in enumerate(own) if "sobol" in row]
    if len(joint) < 2:
        return columns
    tables = [own[n]["sobol"] for n in joint]
    for what, default in (("count", None), ("seed", 0)):
        if len({table.get(what, default) for table in tables}) > 1:
            names = ", ".join(own[n]["name"] for n in joint)
            raise InputError(
                f"axes {names}: sobol has a {what} of its own for each; allowed: the same, they go together"
            )
    ends = [
        [np.atleast_1d(table.get(a, table.get(b))) for table in tables] for a, b in (("from", "low"), ("to", "high"))
    ]
    low, high = (np.concatenate(parts) for parts in ends)
    drawn = sobol(low, high, tables[0]["count"], unit=[""] * low.size, seed=tables[0].get("seed", 0))
    points = np.stack([axis.values for axis in drawn], axis=-1)
    parts = np.split(points, np.cumsum([part.size for part in ends[0]])[:-1], axis=-1)
    for n, part in zip(joint, parts, strict=True):
        columns[n] = Axis(part.reshape(columns[n].values.shape), columns[n].unit)
    return columns


def scatter_of(text: Any, what: str) -> Scatter:
    """Scatter as a study file writes it: `5 %`, or `0.2 mW`.

    Raises:
        InputError: Anything else, or a deviation that is negative or not finite.
    """
    if isinstance(text, str) and text.rstrip().endswith("%"):
        number, unit = 100.0 * quantity(text, "", what), "%"
    else:
        before, _, unit = str(text).strip().partition(" ")
        try:
            number = float(before)
        except ValueError:
            raise InputError(f"{what} is {text!r}; allowed: a deviation such as '5 %' or '0.2 mW'") from None
    try:
        return Scatter(number, unit.strip())
    except InputError as error:
        raise InputError(str(error).replace("scatter", what, 1)) from None
