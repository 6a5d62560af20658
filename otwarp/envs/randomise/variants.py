"""Randomised parameters: a table of variants of a scene, of which each episode takes a row, on the device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from otwarp.envs.task import Task
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.read.variations import Variations
from otwarp.simulation.model import Model
from otwarp.simulation.packing.bodies import is_rigid
from otwarp.simulation.packing.parameters import PARAMETERS, scene_values
from otwarp.simulation.packing.traps import rotate, trap_parameters
from otwarp.studies.axes import Axis, dimensions
from otwarp.studies.design import turned
from otwarp.studies.targets import Target, target_of

MOST = 1024
"""Rows of a table; of more combinations, so many are chosen once and for all."""


class Variants:
    """Rows of a table of a scene's parameters and starts.

    Args:
        task: Whose `randomise` says what varies.
        scene: Its scene.

    Attributes:
        count: Rows, 1 where nothing varies.
        parameters: `(V, …)` values by names of `otwarp.simulation.packing.parameters.PARAMETERS`.
        starts: (V, B, 3) shifts of where bodies start [µm], or None.
        turns: (V, B, 3) rotation vectors by which they start turned [rad], or None.

    Raises:
        InputError: A name or value that the scene does not have, or that cannot differ from world to world.
    """

    def __init__(self, task: Task, scene: Scene):
        found = dimensions(dict(task.randomise))
        rows = combinations([len(d) for d in found], MOST)
        self.count = len(rows)
        self.parameters: dict[str, np.ndarray] = {}
        self.starts: np.ndarray | None = None
        self.turns: np.ndarray | None = None
        for n, dimension in enumerate(found):
            for name, axis in dimension.columns.items():
                self._put(task, scene, name, axis, rows[:, n])

    def _put(self, task: Task, scene: Scene, name: str, axis: Axis, rows: np.ndarray) -> None:
        """Write the values of one axis into the table."""
        # the file tells what an attribute is
        variations = variations_of(task, scene) if name.startswith("/") else cast(Any, None)
        target = target_of(name, scene, variations)
        if target.grouped:
            raise InputError(f"randomise of task {task.name} has {name}, for which each value needs a model of its "
                             "own; allowed: parameters that differ from world to world, start:PRIM, turn:PRIM, or "
                             "GroupedEnv and GroupedVectorEnv of otwarp.envs")  # fmt: skip
        values = target.values(axis)[rows]
        if target.kind == "start":
            self._put_start(target, scene, values)
            return
        if target.kind == "turn":
            self._put_turn(task, target, scene, values)
            return
        table = self.parameters.get(target.key)
        if table is None:
            table = np.repeat(_authored(task, scene, target.key)[None], self.count, axis=0)
        part = table if target.index is None else table[:, target.index]
        part = part if target.component is None else part[..., target.component]
        part[...] = values.reshape(self.count, *(1,) * (part.ndim - values.ndim), *values.shape[1:])
        self.parameters[target.key] = table

    def _put_start(self, target: Target, scene: Scene, values: np.ndarray) -> None:
        """Write where a body starts, as a shift from where the scene has it."""
        if self.starts is None:
            self.starts = np.zeros((self.count, len(scene.bodies), 3))
        assert target.index is not None
        place = np.array(scene.bodies[target.index].position)
        if target.component is None:
            self.starts[:, target.index] = values - place
        else:
            self.starts[:, target.index, target.component] = values - place[target.component]

    def _put_turn(self, task: Task, target: Target, scene: Scene, values: np.ndarray) -> None:
        """Write by how much a body starts turned."""
        if not any(is_rigid(body) for body in scene.bodies):
            raise InputError(f"randomise of task {task.name} has {target.name}, where no body rotates; "
                             "allowed: parameters, start:PRIM")  # fmt: skip
        if self.turns is None:
            self.turns = np.zeros((self.count, len(scene.bodies), 3))
        assert target.index is not None
        self.turns[:, target.index, slice(None) if target.component is None else target.component] = values

    def orientations(self, model: Model) -> np.ndarray:
        """(1|V, B, 4) quaternions of the bodies at the start."""
        whole = np.array(model.start_orientation())
        if self.turns is None:
            return whole[None]
        count, bodies = self.turns.shape[:2]
        every = np.broadcast_to(whole, (count, bodies, 4)).reshape(-1, 4)
        return turned(every, self.turns.reshape(-1, 3)).reshape(count, bodies, 4)

    def places(self, model: Model) -> np.ndarray:
        """(1|V, B, 3) reference points of the bodies at the start [µm]; prims are turned about their origins."""
        origins = np.array([body.position for body in model.scene.bodies])[None]
        if self.starts is not None:
            origins = origins + self.starts
        return origins + rotate(self.orientations(model), model.reference)

    def rows(self, worlds: int) -> dict[str, np.ndarray]:
        """Parameters of so many worlds at first: the rows one after the other."""
        chosen = np.arange(worlds) % self.count
        return {name: table[chosen] for name, table in self.parameters.items()}


def combinations(lengths: Sequence[int], most: int) -> np.ndarray:
    """(V, D) indices of values along D dimensions: all combinations, or `most` of them drawn once."""
    total = math.prod(lengths)
    if total <= most:
        return np.stack(np.unravel_index(np.arange(total), lengths), axis=1) if lengths else np.zeros((1, 0), dtype=int)
    draws = np.random.Generator(np.random.Philox(0))
    return np.stack([draws.integers(0, n, most) for n in lengths], axis=1)


def variations_of(task: Task, scene: Scene) -> Variations:
    """What tells of attributes of a task's scene, and gives them other values: its file.

    Raises:
        InputError: It has none.
    """
    if scene.file is None:
        raise InputError(f"randomise of task {task.name} has attributes of the stage, but its scene has no file; "
                         "allowed: a scene that was loaded, SceneBuilder saves one")  # fmt: skip
    return Variations(scene.file)


def _authored(task: Task, scene: Scene, name: str) -> np.ndarray:
    """What the scene has of a parameter: () of medium and flow, (T) or (T, 3) of traps, (B) or (B, 3) of bodies."""
    known = trap_parameters(scene) if PARAMETERS[name].of == "traps" else scene_values(scene)
    if name not in known:
        raise InputError(f"randomise of task {task.name} has {name}; "
                         "allowed: parameters of medium, flow, traps and bodies")  # fmt: skip
    return known[name][0] if PARAMETERS[name].of else np.array(float(np.ravel(known[name])[0]))
