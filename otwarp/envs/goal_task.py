"""Any scene that has a goal as an environment, by one call."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from otwarp.envs import terms as t
from otwarp.envs.task import Hand, Task
from otwarp.envs.terms import Term
from otwarp.errors import InputError
from otwarp.scene import Goal, Scene

SCALE = 20.0
"""Of places in the scene, where 1 is observed [µm]."""


def from_scene(scene: Scene | str | Path, **changes: Any) -> Task:
    """The task that a scene's goal sets: bring its cell there, with the hands that its traps name.

    Observed are the ways from the cell to the goal and to each robot that is not the cell itself, velocities, and for
    each hand what its first trap pulls by. An episode ends with `reached`, the cell within the goal's tolerance, which
    is success; with `lost`, a robot out of its trap; and, of two robots, with `left_behind`, a cell far from their
    middle. Running into an obstacle ends nothing.

    Args:
        scene: With an `OtGoalAPI`, and traps that name a hand; or its file.
        changes: Attributes of `Task` that are to be others.

    Returns:
        A task, for `Env`, `VectorEnv` or `Batch`.

    Raises:
        InputError: No goal, no trap of a hand, or an attribute that `Task` does not have.

    Example:
        >>> import otwarp.envs as envs
        >>> task = envs.from_scene("scenes/teleop_small.usda", time_limit=15.0)
        >>> [hand.name for hand in task.hands]
        ['left', 'right']
    """
    if not isinstance(scene, Scene | str | Path):
        raise InputError(f"scene is {scene!r}; allowed: a Scene, or the file of one")
    loaded = scene if isinstance(scene, Scene) else Scene.load(scene)
    where = loaded.file or loaded.root
    goal = loaded.goal
    if goal is None:
        raise InputError(f"{where}: has no goal; allowed: a scene with an OtGoalAPI prim")
    hands = [
        Hand(name=side, traps=traps, axes="xyz")
        for side in ("left", "right")
        if (traps := tuple(trap.prim for trap in loaded.traps if trap.hand == side))
    ]
    if not hands:
        raise InputError(f"{where}: no trap has ot:trap:hand = left or right; allowed: a scene with traps for hands")
    fields = {f.name for f in dataclasses.fields(Task)}
    for name in changes:
        if name not in fields:
            raise InputError(f"option {name!r} of from_scene is unknown; allowed: {', '.join(sorted(fields))}")
    limits = [trap.speed_limit for trap in loaded.traps if trap.hand != "none"]
    made: dict[str, Any] = {
        "name": f"otwarp/{Path(where).stem}",
        "scene": loaded,
        "description": "Bring the cell of the scene to its goal.",
        "hands": tuple(hands),
        "observations": tuple(_observed(loaded, hands)),
        "rewards": (
            t.progress(body=goal.cell, weight=0.1),
            t.passing(weight=-0.05),
            t.arrival(body=goal.cell, radius=goal.tolerance),
        ),
        "ends": tuple(_ends(goal)),
        "time_limit": max(loaded.settings.duration, 1.0),
        "speed_limit": min([10.0, *limits]),
    }
    return Task(**(made | changes))


def _ends(goal: Goal) -> list[Term]:
    """Success, lost robots, and a cell that two robots leave behind."""
    ends = [
        t.reached(body=goal.cell, radius=goal.tolerance, success=True),
        t.lost(distance=goal.lost_distance),
    ]
    if len(goal.robots) == 2:
        left, right = goal.robots
        far = goal.cell_lost_distance
        ends.append(t.left_behind(distance=far, cell=goal.cell, left=left, right=right))
    return ends


def _observed(scene: Scene, hands: list[Hand]) -> list[Term]:
    """What is observed of a scene with a goal."""
    goal = scene.goal
    assert goal is not None
    seen = [
        t.goal_offset(body=goal.cell, scale=SCALE),
        t.body_velocity(body=goal.cell, name="cell_velocity"),
        t.gap(body=goal.cell, name="cell_gap"),
    ]
    # a robot that is to get there itself is the cell, which is seen above
    for robot, short in _short_names([name for name in goal.robots if name != goal.cell]).items():
        seen += [
            t.body_offset(body=goal.cell, other=robot, scale=SCALE, name=f"{short}_offset"),
            t.body_velocity(body=robot, name=f"{short}_velocity"),
            t.gap(body=robot, name=f"{short}_gap"),
        ]
    return seen + [t.trap_offset(trap=hand.traps[0], name=f"{hand.name}_trap_offset") for hand in hands]


def _short_names(prims: Sequence[str]) -> dict[str, str]:
    """Prim paths → the fewest last parts of each that tell them all apart, and none from the cell."""
    parts = [prim.strip("/").split("/") for prim in prims]
    for count in range(1, max(map(len, parts), default=0) + 1):
        shorts = ["_".join(part[-count:]) for part in parts]
        if len({*shorts, "cell"}) > len(shorts):
            return dict(zip(prims, shorts, strict=True))
    return {prim: f"robot_{n}" for n, prim in enumerate(prims, 1)}
