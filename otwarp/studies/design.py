"""The points of a study: every combination of the values along its dimensions, in order, and the groups they form."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Body, Scene
from otwarp.scene.check.overlap import check_overlaps
from otwarp.scene.read.variations import Variations
from otwarp.studies.axes import Dimension
from otwarp.studies.targets import Target, target_of, variant

MOST_STARTS = 1_024
"""Different starts that are looked at before a study runs."""

MOST_POINTS = 2**24
"""Points of a study, at most."""


@dataclass(frozen=True, eq=False)
class Column:
    """What one name is along its dimension, in the unit of its target."""

    target: Target
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Design:
    """Points in the order of their dimensions, the last one fastest.

    Attributes:
        scene: The scene as it is in its file.
        variations: What gives it other attributes.
        dimensions: As they were given; none for a study of one point.
        columns: Per dimension, what varies along it.
    """

    scene: Scene
    variations: Variations
    dimensions: tuple[Dimension, ...]
    columns: tuple[tuple[Column, ...], ...]

    @classmethod
    def of(cls, scene: Scene, variations: Variations, dimensions: Sequence[Dimension]) -> Design:
        """Read names and units in a scene.

        Raises:
            InputError: A name, unit or value that is none of this scene's, or too many points.
        """
        columns = tuple(
            tuple(Column(t := target_of(name, scene, variations), t.values(axis)) for name, axis in d.columns.items())
            for d in dimensions
        )
        design = cls(scene, variations, tuple(dimensions), columns)
        if design.points > MOST_POINTS:
            raise InputError(f"the study has {design.points} points; allowed: up to {MOST_POINTS}")
        keys = [(c.target.kind, c.target.key, c.target.index, c.target.component) for along in columns for c in along]
        if len(set(keys)) < len(keys):
            raise InputError("two axes turn the same thing; allowed: one axis for each")
        return design

    @property
    def grouped(self) -> bool:
        """Whether some points have models of their own."""
        return bool(self.grouped_by)

    @property
    def grouped_by(self) -> tuple[str, ...]:
        """Names of the axes whose values each need a model of their own."""
        return tuple(c.target.name for along in self.columns for c in along if c.target.grouped)

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along each dimension."""
        return tuple(len(d) for d in self.dimensions)

    @property
    def points(self) -> int:
        """How many points there are."""
        return int(np.prod(self.shape, dtype=np.int64))

    def at(self, points: np.ndarray) -> dict[Target, np.ndarray]:
        """What each target is at some points, by their numbers: (n) or (n, 3)."""
        places = np.unravel_index(points, self.shape) if self.shape else ()
        return {c.target: c.values[place] for along, place in zip(self.columns, places, strict=True) for c in along}

    def groups(self, points: np.ndarray) -> list[tuple[np.ndarray, dict[Target, Any]]]:
        """Points that share a model, and what their model is made with; in the order of their first points."""
        turned = [n for n, along in enumerate(self.columns) if any(c.target.grouped for c in along)]
        if not turned:
            return [(points, {})]
        places = np.stack(np.unravel_index(points, self.shape))[turned]
        found, which = np.unique(places, axis=1, return_inverse=True)
        which = which.ravel()
        first = [int(np.argmax(which == g)) for g in range(found.shape[1])]
        out = []
        for g in np.argsort(first):
            own = points[which == g]
            values = {t: v[0] for t, v in self.at(own[:1]).items() if t.grouped}
            out.append((own, values))
        return out

    def group_of(self, point: int) -> np.ndarray:
        """All points that share their model with one."""
        place = np.unravel_index(point, self.shape) if self.shape else ()
        where = tuple(
            int(i) if any(c.target.grouped for c in along) else slice(None)
            for along, i in zip(self.columns, place, strict=True)
        )
        return np.arange(self.points).reshape(self.shape)[where].ravel()

    def scene_of(self, values: dict[Target, Any]) -> Scene:
        """The scene of a group.

        Raises:
            InputError: It cannot be accepted; the message names the values.
        """
        try:
            return variant(self.scene, self.variations, values)
        except InputError as error:
            raise at_values(error, values) from None

    def some(self, points: np.ndarray, most: int) -> np.ndarray:
        """All of some points; of more than `most` as many, evenly chosen, and those at the ends of each value."""
        if len(points) <= most:
            return points
        chosen = [points[np.linspace(0, len(points) - 1, most).astype(int)]]
        for v in self.at(points).values():
            if v.dtype.kind == "f":
                chosen += [points[np.argmin(v, axis=0)], points[np.argmax(v, axis=0)]]
        return np.unique(np.concatenate([np.atleast_1d(c) for c in chosen]))

    def coordinates(self) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
        """Per name, dimensions, values and attributes of a coordinate in a table, in the units that were written."""
        out: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
        for d in self.dimensions:
            for n, (name, axis) in enumerate(d.columns.items()):
                label = d.name if n == 0 else f"{d.name}_{n}"
                known = {"long_name": name, **({"units": axis.unit} if axis.unit else {})}
                if axis.values.ndim == 1:
                    out[label] = ((d.name,), axis.values, known)
                else:
                    for letter, column in zip("xyz", axis.values.T, strict=True):
                        out[f"{label}_{letter}"] = ((d.name,), column, known | {"long_name": f"{name}, {letter}"})
        return out


def at_values(error: InputError, values: dict[Target, Any]) -> InputError:
    """The error, with the values of the group in which it came."""
    said = {t: f"{v:.6g}" if isinstance(v, float) else v for t, v in values.items()}
    where = ", ".join(f"{t.name} = {v} {t.unit}".rstrip() for t, v in said.items())
    return InputError(f"at {where}: {error}") if where else error


def check_starts(design: Design) -> None:
    """Refuse points at which a body starts with its middle inside an obstacle or another body, placed or turned so.

    Of more than `MOST_STARTS` different starts as many, evenly chosen, are looked at.

    Raises:
        InputError: Which point, and what overlaps.
    """
    posed = [n for n, along in enumerate(design.columns) if any(c.target.kind in ("start", "turn") for c in along)]
    if not posed:
        return
    shape = [len(design.dimensions[n]) for n in posed]
    count = int(np.prod(shape, dtype=np.int64))
    scene = design.scene
    for number in np.unique(np.linspace(0, count - 1, min(count, MOST_STARTS)).astype(int)):
        columns = [
            (c.target, c.values[at])
            for n, at in zip(posed, np.unravel_index(number, shape), strict=True)
            for c in design.columns[n]
            if c.target.kind in ("start", "turn")
        ]
        bodies = _posed(scene.bodies, columns)
        where = f"at {', '.join(f'{t.name} = {v} {t.unit}' for t, v in columns)}"
        check_overlaps(where, bodies, scene.obstacles, share=1.0, period=scene.settings.period)


def _posed(bodies: Sequence[Body], columns: Sequence[tuple[Target, Any]]) -> list[Body]:
    """Bodies where starts put them, turned about the origins of their prims."""
    places = np.array([b.position for b in bodies], dtype=float)
    vectors = np.zeros((len(bodies), 3))
    for target, value in columns:
        into = places if target.kind == "start" else vectors
        into[target.index, slice(None) if target.component is None else target.component] = value
    out = []
    for body, place, vector in zip(bodies, places.tolist(), vectors, strict=True):
        changed: dict[str, Any] = {"position": tuple(place)}
        if np.any(vector):
            changed["orientation"] = tuple(turned(np.array([body.orientation]), vector[None])[0].tolist())
        out.append(dataclasses.replace(body, **changed))
    return out


def turned(orientation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """(n, 4) quaternions turned by (n, 3) rotation vectors in world axes [rad]."""
    from scipy.spatial.transform import Rotation

    return (Rotation.from_rotvec(vector) * Rotation.from_quat(orientation)).as_quat()


def blocks(shape: tuple[int, ...], size: int) -> list[tuple[slice, ...]]:
    """A grid cut into blocks of up to `size` points that are whole along the last dimensions, in order."""
    cut = [1] * len(shape)
    for n in range(len(shape) - 1, -1, -1):
        cut[n] = min(shape[n], max(1, size))
        size //= shape[n]
    return cut_blocks(shape, cut)


def cut_blocks(shape: tuple[int, ...], cut: Sequence[int]) -> list[tuple[slice, ...]]:
    """A grid cut into blocks of so many points along each dimension, in order; those at its ends may have fewer."""
    ranges = [[slice(a, min(a + c, n)) for a in range(0, n, c)] for n, c in zip(shape, cut, strict=True)]
    return list(itertools.product(*ranges))


def box_of(blocks: Sequence[tuple[slice, ...]]) -> tuple[slice, ...] | None:
    """The points that blocks, none of them twice, have together, where these are a box; else None."""
    box = tuple(slice(min(s.start for s in along), max(s.stop for s in along)) for along in zip(*blocks, strict=True))
    count = sum(math.prod(s.stop - s.start for s in block) for block in blocks)
    return box if math.prod(s.stop - s.start for s in box) == count else None
