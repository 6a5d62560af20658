"""Tasks whose scenes differ in what a model fixes: attributes of the stage, and speeds of paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from otwarp.envs.randomise.variants import combinations, variations_of
from otwarp.envs.task import Task, check_task
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.studies.axes import Dimension, dimensions, values
from otwarp.studies.targets import Target, target_of, variant

MOST = 64
"""Tasks, each of which has a model of its own; of more combinations, so many are chosen once and for all."""


def group_tasks(task: Task) -> tuple[Task, ...]:
    """The tasks that a task stands for, one for each combination of values that need a model of their own.

    Args:
        task: Whose `randomise` may have attributes of the stage, such as `/World/cell/sphere.radius`, and `speed:TRAP`
            of a trap that no hand moves.

    Returns:
        The task itself where there are none; else up to `MOST`, whose scenes have those values, and whose `randomise`
        is what is left.

    Raises:
        InputError: A name or value that the scene's file does not have, a scene that was changed where it varies, or
            the speed of a trap that actions move.
    """
    check_task(task)
    found = _found(task)
    grouped = [d for d, targets in found.items() if any(t.grouped for t in targets.values())]
    if not grouped:
        return (task,)
    scene, where = task.load(), f"scene of task {task.name}"
    variations = variations_of(task, scene)
    left: dict[Any, Any] = {tuple(d.columns): tuple(d.columns.values()) for d in found if d not in grouped}
    read = variations.scene({})
    made: list[tuple[Scene, Scene]] = []
    tasks = []
    for row in combinations([len(d) for d in grouped], MOST):
        fixed: dict[Target, Any] = {}
        single: dict[str, Any] = {}
        for dimension, n in zip(grouped, row, strict=True):
            for name, target in found[dimension].items():
                axis = dimension.columns[name]
                if target.grouped:
                    fixed[target] = target.values(axis)[n]
                else:
                    single[name] = values(axis.values[n : n + 1], unit=axis.unit)
        varied = variant(read, variations, fixed)
        changed = merged(read, scene, varied, where)
        made.append((varied, changed))
        if varied != made[0][0] and changed == made[0][1]:
            raise _twice(where)
        changed = dataclasses.replace(changed, overrides={**scene.overrides, **varied.overrides})
        tasks.append(dataclasses.replace(task, scene=changed, randomise={**left, **single}))
    return tuple(tasks)


def scenes_differ(task: Task) -> bool:
    """Whether a task stands for several, as of `group_tasks`."""
    return any(t.grouped for targets in _found(task).values() for t in targets.values())


def _found(task: Task) -> Mapping[Dimension, Mapping[str, Target]]:
    """What the names of each dimension turn; nothing where none of them can need a model of its own.

    Raises:
        InputError: A name that is none, or the speed of a trap that actions move.
    """
    along = dimensions(dict(task.randomise))
    if not any(name.startswith(("/", "speed:")) for d in along for name in d.columns):
        return {}
    scene = task.load()
    variations = variations_of(task, scene)
    found = {d: {name: target_of(name, scene, variations) for name in d.columns} for d in along}
    moved = {prim for hand in task.hands for prim in hand.traps}
    for target in (t for targets in found.values() for t in targets.values()):
        if target.kind == "speed" and target.key in moved:
            raise InputError(f"randomise of task {task.name} has {target.name}, a trap that actions move; "
                             "allowed: the speed of a trap that follows its path")  # fmt: skip
    return found


def merged(base: Any, own: Any, other: Any, where: str) -> Any:
    """What `own` makes of `base`, and `other` as well, in nested dataclasses and tuples.

    Args:
        base: As it was.
        own, other: Changed, each in places of its own.
        where: What they are, for messages.

    Raises:
        InputError: Both have changed the same thing, each otherwise.
    """
    if _equal(base, own) or _equal(own, other):
        return other
    if _equal(base, other):
        return own
    if type(base) is type(own) is type(other):
        if dataclasses.is_dataclass(own) and not isinstance(own, type):
            names = [f.name for f in dataclasses.fields(own) if f.init and f.compare]
            three = {name: [getattr(one, name) for one in (base, own, other)] for name in names}
            return dataclasses.replace(own, **{n: merged(*t, where=f"{where}, {n}") for n, t in three.items()})
        if isinstance(own, tuple) and len(base) == len(own) == len(other):
            each = enumerate(zip(base, own, other, strict=True))
            return tuple(merged(*three, where=f"{where}[{n}]") for n, three in each)
    raise _twice(where)


def _twice(where: str) -> InputError:
    """What is said of a place that two have changed."""
    return InputError(f"{where}: changed by the task, and by what is randomised; allowed: one of both")


def _equal(a: Any, b: Any) -> bool:
    """Whether two parts of scenes are the same."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    if isinstance(a, float) and isinstance(b, float) and np.isnan(a) and np.isnan(b):
        return True
    return bool(a == b)
