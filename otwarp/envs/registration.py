"""The shipped environments by name, for Gymnasium to make."""

from __future__ import annotations

import ast
import dataclasses
import inspect
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from otwarp.errors import InputError
from otwarp.shipped import named

if TYPE_CHECKING:
    from otwarp.envs.task import Task

TASKS = {
    "otwarp/Navigate-v0": "navigate",
    "otwarp/Push-v0": "push",
    "otwarp/Hold-v0": "hold",
    "otwarp/Orient-v0": "orient",
    "otwarp/CellDelivery-v0": "cell_delivery",
    "otwarp/CellDeliveryOTGym-v0": "ot_gym",
}
"""Name of an environment → file of `otwarp.envs.tasks`, whose function `task` makes its task."""


def about(name: str) -> str:
    """What is to be done in a shipped environment, in one sentence: read from its file, which is not run."""
    said = ast.get_docstring(ast.parse((Path(__file__).parent / "tasks" / f"{TASKS[name]}.py").read_text("utf-8")))
    first = " ".join((said or "").split("\n\n")[0].split()).split(": ", 1)[-1]
    return first[:1].upper() + first[1:]


def task_of(name: str, **changes: Any) -> Task:
    """The task of a shipped environment.

    Args:
        name: Such as `otwarp/Navigate-v0`.
        changes: Attributes of `Task` that are to be others, and options of its own: `strategy` of Orient, `A` or `B`.

    Raises:
        InputError: There is none of that name, or an option that neither `Task` nor this one has.
    """
    if name not in TASKS:
        raise InputError(f"environment {name!r} is unknown; allowed: {', '.join(TASKS)}")
    make = import_module(f"otwarp.envs.tasks.{TASKS[name]}").task
    own = {option: changes.pop(option) for option in inspect.signature(make).parameters if option in changes}
    task = make(**own)
    allowed = {f.name for f in dataclasses.fields(task)} | set(inspect.signature(make).parameters)
    for change in changes:
        if change not in allowed:
            raise InputError(f"option {change!r} of {name} is unknown; allowed: {', '.join(sorted(allowed))}")
    changed = dataclasses.replace(task, **changes)
    if check := own_spaces(name, "check"):
        check(changed)
    return changed


def task_named(name: str, **changes: Any) -> Task:
    """The task of a shipped environment, or of a scene with a goal.

    Args:
        name: Of an environment, a USD file, or the name of a shipped scene such as `teleop_small`.
        changes: As of `task_of`.

    Raises:
        InputError: Neither, or a wrong option.
    """
    from otwarp.envs.goal_task import from_scene

    if Path(name).suffix in (".usd", ".usda", ".usdc", ".usdz") or named("scenes", name):
        return from_scene(name, **changes)
    if name not in TASKS:
        raise InputError(
            f"{name!r} is unknown; allowed: {', '.join(TASKS)}, or a scene: its file, or its name if shipped"
        )
    return task_of(name, **changes)


ENV_OPTIONS = ("device", "render_mode")
VECTOR_OPTIONS = ("device", "arrays", "autoreset_mode", "render_mode", "render_envs")


def _split(options: dict[str, Any], own: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of an environment, and those that change its task."""
    return {k: v for k, v in options.items() if k in own}, {k: v for k, v in options.items() if k not in own}


def make_env(name: str, **options: Any) -> Any:
    """One environment; see `Env`, `GroupedEnv` and `task_of` for its options."""
    from otwarp.envs.grouped import environment

    own, changes = _split(options, ENV_OPTIONS)
    return _wrapped(name, environment(task_of(name, **changes), **own))


def make_vector(name: str, num_envs: int = 1, **options: Any) -> Any:
    """Many environments; see `VectorEnv`, `GroupedVectorEnv` and `task_of` for their options."""
    from otwarp.envs.grouped import environments

    own, changes = _split(options, VECTOR_OPTIONS)
    return _wrapped(name, environments(task_of(name, **changes), num_envs, **own))


def _wrapped(name: str, env: Any) -> Any:
    """With the spaces that the file of its task gives it by `wrap`, if these are others than those of the task."""
    wrap = own_spaces(name, "wrap")
    return env if wrap is None else wrap(env)


def own_spaces(name: str, function: str) -> Any:
    """A function of a task's file that exists where an environment has other spaces than its task; else None.

    Args:
        name: Of the environment.
        function: `wrap`, which makes it of the task's; `described`, its `observations` and `actions` as rows of tables;
            `check`, which refuses a task whose options its spaces do not allow.
    """
    return getattr(import_module(f"otwarp.envs.tasks.{TASKS[name]}"), function, None) if name in TASKS else None


def register_all() -> None:
    """Register the shipped environments with Gymnasium.

    Raises:
        InputError: Gymnasium is not installed.
    """
    try:
        import gymnasium
    except ImportError:
        raise InputError("otwarp.envs needs gymnasium; allowed: pip install 'otwarp[envs]'") from None
    for name in TASKS:
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="otwarp.envs.registration:make_env",
                vector_entry_point="otwarp.envs.registration:make_vector",
                kwargs={"name": name},
            )
