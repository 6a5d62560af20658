"""Numbers of worlds: parameters and starts as rows of arrays, and what scatters from trial to trial."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.traps import rotate
from otwarp.studies.axes import Scatter
from otwarp.studies.design import turned
from otwarp.studies.quantity import ratio
from otwarp.studies.targets import Target

FARTHEST = 4.0
"""Deviations that a scattered parameter is off at most: normal numbers are drawn within, so that it is known before a
study runs what all of its trials will meet."""


def normal_of(seed: int, stream: int, trials: np.ndarray) -> np.ndarray:
    """(n) standard normal numbers up to `FARTHEST` that are functions of seed, stream and number of a trial alone.

    Philox with the number as its counter (Salmon et al. 2011, doi:10.1145/2063384.2063405), four trials a block.
    """
    from scipy.special import ndtr, ndtri

    beyond = ndtr(-FARTHEST)
    numbers = np.asarray(trials, dtype=np.uint64)
    order = np.argsort(numbers, kind="stable")
    out = np.empty(len(numbers))
    cuts = np.flatnonzero(np.diff(numbers[order]) != 1) + 1
    for run in np.split(order, cuts):
        first, count = int(numbers[run[0]]), len(run)
        bits = np.random.Philox(key=[seed, stream + 1], counter=[first // 4, 0, 0, 0])
        raw = bits.random_raw(first % 4 + count)[first % 4 :]
        even = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
        out[run] = ndtri(beyond + (1.0 - 2.0 * beyond) * even)
    return out


@dataclass(frozen=True, eq=False)
class _Asked:
    """A scene and options as a key: equal to those that are the same objects."""

    scene: Scene
    options: StepOptions

    def __hash__(self) -> int:
        return hash((id(self.scene), id(self.options)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Asked) and self.scene is other.scene and self.options is other.options


def origin_of(scene: Scene, options: StepOptions) -> Model:
    """One world of the scene on the CPU: what parameters and starts are where nothing else is said."""
    return _origin_of(_Asked(scene, options))


@functools.lru_cache(maxsize=8)
def _origin_of(asked: _Asked) -> Model:
    precision, forces = asked.options.precision, asked.options.forces
    return Model.build(asked.scene, device="cpu", options=StepOptions(precision=precision, forces=forces))


def width_of(mean: np.ndarray, target: Target, scatter: Scatter) -> Any:
    """Standard deviation of a scattered parameter, in its target's unit.

    Args:
        mean: What it scatters about.
        target: The parameter.
        scatter: As it was asked for.

    Raises:
        InputError: A unit of another kind.
    """
    if scatter.unit == "%":
        return 0.01 * scatter.deviation * np.abs(mean)
    return scatter.deviation * ratio(scatter.unit, target.unit, f"scatter of {target.name}")


def base_of(origin: Model, target: Target) -> np.ndarray:
    """The own value of a parameter of a scene, as one row.

    Args:
        origin: A model of the scene.
        target: The parameter.
    """
    values = origin.values[target.key]
    if target.index is not None:
        values = values[:, target.index]
    elif values.ndim > 1:
        values = values[:, 0]
    return values if target.component is None else values[..., target.component]


def parameter_rows(origin: Model, values: dict[Target, np.ndarray], n: int) -> dict[str, np.ndarray]:
    """Parameters of `Simulation`, a row for each of n worlds."""
    rows: dict[str, np.ndarray] = {}
    for target, given in values.items():
        if target.kind != "parameter":
            continue
        base = rows.get(target.key)
        if base is None:
            own = origin.values[target.key]
            base = np.broadcast_to(own, (n, *own.shape[1:])).copy()
            rows[target.key] = base
        where: Any = (slice(None),) if target.index is None else (slice(None), target.index)
        part = base[where]
        column = given
        while column.ndim < part.ndim and target.index is None and target.component is None:
            column = column[:, None]
        if target.component is None:
            base[where] = column
        else:
            base[(*where, ..., target.component) if target.index is None else (*where, target.component)] = (
                given[:, None] if part.ndim == 3 else given
            )
    return rows


def start_rows(origin: Model, values: dict[Target, np.ndarray], n: int) -> dict[str, np.ndarray]:
    """Starts of n worlds for `Simulation.reset`: nothing where the scene's own serve."""
    turns = {t: v for t, v in values.items() if t.kind == "turn"}
    starts = {t: v for t, v in values.items() if t.kind == "start"}
    if not turns and not starts:
        return {}
    bodies = origin.scene.bodies
    place = np.broadcast_to(np.array([b.position for b in bodies]), (n, len(bodies), 3)).copy()
    orientation = np.broadcast_to(origin.start_orientation(), (n, len(bodies), 4)).copy()
    for target, given in starts.items():
        place[:, target.index, slice(None) if target.component is None else target.component] = given
    vectors: dict[int, np.ndarray] = {}
    for target, given in turns.items():
        assert target.index is not None
        vector = vectors.setdefault(target.index, np.zeros((n, 3)))
        vector[:, slice(None) if target.component is None else target.component] = given
    for b, vector in vectors.items():
        orientation[:, b] = turned(orientation[:, b], vector)
    # where all are turned alike, so are their reference points: a million of them need not be turned one by one
    place += rotate(orientation if turns else orientation[:1], origin.reference)
    return {"position": place} | ({"orientation": orientation} if turns else {})
