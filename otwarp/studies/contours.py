"""Where a probability has a level on a map: lines through the table, with those between which they lie."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.errors import InputError

ENDS = {"estimate": "", "inside": "_low", "outside": "_high"}
"""Which values a line is drawn through: the estimate, or an end of its intervals."""


def equal_factors(x: np.ndarray) -> bool:
    """Whether values lie about equal factors apart, so that halfway between two of them is their geometric mean."""
    x = np.sort(np.asarray(x, dtype=float))
    if len(x) < 3 or not np.all(x > 0.0):
        return False
    steps = np.diff(x)
    return bool(not np.allclose(steps, steps[0], rtol=1e-3) and np.allclose(np.diff(np.log(x)), np.log(x[1] / x[0])))


def contour_lines(found: Any, name: str, level: float) -> Any:
    """The contour P = `level` of a map, as an `xarray.Dataset` with a row for each vertex.

    Lines are traced by marching squares (Lorensen and Cline 1987, doi:10.1145/37401.37422, in the plane) between the
    points, where values by equal factors are taken by their logarithms. Points between the lines `inside`, through the
    lower ends of the intervals, and `outside`, through the upper ones, may have the level; the truth crosses a grid
    line elsewhere no more often than its intervals miss.

    Args:
        found: What `Study.run` or `table` gave, of two dimensions longer than 1.
        name: Of a probability in it.
        level: A probability above 0 and below 1.

    Returns:
        `line` (its number), `through` (`estimate`, `inside` or `outside`), and a coordinate of each dimension.

    Raises:
        InputError: No such probability or level, or another number of dimensions.
    """
    import contourpy
    import xarray

    if name not in found or f"{name}_low" not in found:
        raise InputError(f"contour of {name!r}; allowed: a probability of the study")
    if not 0.0 < level < 1.0:
        raise InputError(f"contour is {level}; allowed: a probability above 0 and below 1")
    dims = [d for d in found[name].dims if found.sizes[d] > 1]
    if len(dims) != 2 or not all(d in found.coords and found[d].dtype.kind in "fiu" for d in dims):
        raise InputError(
            f"contour of a map over {', '.join(map(str, dims)) or 'nothing'}; allowed: two axes of numbers"
        )
    order = [np.argsort(found[d].values) for d in dims]
    rows: dict[str, list[np.ndarray]] = {"line": [], "through": [], str(dims[0]): [], str(dims[1]): []}
    number = 0
    for through, suffix in ENDS.items():
        z = found[f"{name}{suffix}"].squeeze().transpose(*dims).values[np.ix_(*order)]
        for line in contourpy.contour_generator(z=np.ma.masked_invalid(z)).lines(level):
            assert isinstance(line, np.ndarray)
            rows["line"].append(np.full(len(line), number))
            rows["through"].append(np.full(len(line), through))
            for d, places, at in zip(dims, (line[:, 1], line[:, 0]), order, strict=True):
                rows[str(d)].append(_between(found[d].values[at], places))
            number += 1
    parts = {k: np.concatenate(v) if v else np.empty(0) for k, v in rows.items()}
    about = {"long_name": f"contour P({name}) = {level:g}", "level": level}
    out = xarray.Dataset({k: ("vertex", v) for k, v in parts.items()}, attrs=about)
    for d in dims:
        out[d].attrs = dict(found[d].attrs)
    return out


def _between(x: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values at places between the points of an axis, counted from 0."""
    x = np.asarray(x, dtype=float)
    at = np.arange(len(x))
    return np.exp(np.interp(places, at, np.log(x))) if equal_factors(x) else np.interp(places, at, x)
