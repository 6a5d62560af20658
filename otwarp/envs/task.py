"""What an environment is made of: a scene, hands that move its traps, terms, randomisation, and an expert."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from otwarp.envs import task_arguments as arguments
from otwarp.envs.terms import Term
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.studies.axes import axis_of

ActionKind = Literal["velocity", "power", "both"]
Observation = Literal["state", "image", "both"]
Policy = Callable[[Mapping[str, np.ndarray], np.ndarray], np.ndarray]
"""`(seen, fresh) -> (N, A)`: observed columns by name, each (N) in their own units, and (N) bool, whether an episode
has just begun; returns numbers within ±1."""

MOST_PIXELS, MOST_BINNED = 512, 8
"""Largest side of an image of a task, and of a pixel of it in pixels of the camera."""


@dataclass(frozen=True, kw_only=True)
class Hand:
    """Traps that an action moves together.

    Attributes:
        name: In the names of the numbers of an action, and of the agent in PettingZoo.
        traps: Prim paths of its traps.
        axes: Along which it moves.
    """

    name: str
    traps: tuple[str, ...]
    axes: str = "xy"

    def __post_init__(self) -> None:
        for name in ("name", "axes"):
            _check_text(f"{name} of a hand", getattr(self, name))
        object.__setattr__(self, "traps", arguments.items(f"traps of hand {self.name}", self.traps, str, "prim paths"))


@dataclass(frozen=True, kw_only=True)
class Shift:
    """Bodies and traps that start elsewhere in each episode, moved together, uniformly within a box.

    Attributes:
        bodies, traps: Prim paths.
        half: Half widths of the box [µm].
        middle: Of the box, from where the scene has them [µm].
    """

    bodies: tuple[str, ...] = ()
    traps: tuple[str, ...] = ()
    half: tuple[float, float, float]
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("bodies", "traps"):
            prims = arguments.items(f"{name} of a shift", getattr(self, name), str, "prim paths")
            object.__setattr__(self, name, prims)
        for name, least in (("half", 0.0), ("middle", -arguments.MOST_LENGTH)):
            box = arguments.triple(f"{name} of a shift", getattr(self, name), least=least)
            object.__setattr__(self, name, box)


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """An environment's task.

    Attributes:
        name: Of the environment, such as `otwarp/Navigate-v0`.
        scene: The scene, or the file of one.
        hands: What actions move; traps of no hand stay as the scene has them.
        observations: Terms that are observed, one after the other.
        rewards: Terms that are earned, each times its `weight`; their sum is the reward.
        ends: Terms that terminate an episode, the first one that says so; those with `success` are what is wanted.
        description: What is to be done, in a sentence.
        action: What the numbers of an action set: the velocities of hands, powers of traps, or both.
        power: Least and largest power of a trap [mW], where actions set powers.
        power_each: Whether each trap has a power of its own, instead of one for all traps of a hand.
        choices: Rows of numbers, where an action is one of them instead: (n, A).
        speed_limit: Largest speed of a hand [µm/s].
        rate: Control periods a second [Hz].
        time_limit: After which an episode is truncated [s].
        goal: Place of the goal [µm]; None for the scene's, or 0.
        goal_half: Half widths of the box about it in which the goal of an episode lies [µm].
        shifts: What starts elsewhere in each episode.
        randomise: What differs from episode to episode: axes of `otwarp.studies` by name, such as
            `{"trap_power": ot.studies.random(4, 6, 64, unit="mW")}`, or tables as in a study's file, such as
            `{"trap_power": {"values": [4, 5, 6], "unit": "mW"}}`; one value of each axis is chosen anew.
        observation: What is observed: the `state`, which are the terms; an `image` of the microscope; or `both`.
        image_size: Width and height of images [pixels].
        image_binning: Pixels of the camera along each side of a pixel of an image, which is their mean.
        image_follows: Whether the microscope follows the body that hands hold, instead of staying where the scene's is.
        expert: Makes a scripted policy, which remembers what it needs between the steps of its environments.
    """

    name: str
    scene: Scene | str | Path = field(repr=False)
    hands: tuple[Hand, ...]
    observations: tuple[Term, ...] = field(repr=False)
    rewards: tuple[Term, ...] = field(repr=False)
    ends: tuple[Term, ...] = field(repr=False)
    description: str = ""
    action: ActionKind = "velocity"
    power: tuple[float, float] = (0.0, 10.0)
    power_each: bool = False
    choices: tuple[tuple[float, ...], ...] = field(default=(), repr=False)
    speed_limit: float = 10.0
    rate: float = 20.0
    time_limit: float = 20.0
    goal: tuple[float, float, float] | None = None
    goal_half: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shifts: tuple[Shift, ...] = ()
    randomise: Mapping[Any, Any] = field(default_factory=dict, repr=False)
    observation: Observation = "state"
    image_size: tuple[int, int] = (64, 64)
    image_binning: int = 2
    image_follows: bool = True
    expert: Callable[[], Policy] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        _check_text("name of a task", self.name)
        if not isinstance(self.scene, Scene | str | Path):
            raise InputError(f"{self._of('scene')} is {self.scene!r}; allowed: a Scene, or the file of one")
        self._read_lists()
        self._read_numbers()
        self._check_kinds()
        self._check_terms()

    def _read_lists(self) -> None:
        """Hands, terms and shifts, as tuples."""
        terms = dict.fromkeys(("observations", "rewards", "ends"), (Term, "terms"))
        for name, (kind, what) in {"hands": (Hand, "hands"), **terms, "shifts": (Shift, "shifts")}.items():
            self._set(name, arguments.items(self._of(name), getattr(self, name), kind, what))
        if not self.hands or not self.observations or not self.rewards or not self.ends:
            raise InputError(f"task {self.name}: allowed: at least one hand, observation, reward and end")
        names = [hand.name for hand in self.hands]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"task {self.name} has two hands {name!r}; allowed: a name for each")
        if not isinstance(self.randomise, Mapping):
            raise InputError(f"{self._of('randomise')} is {self.randomise!r}; allowed: axes of otwarp.studies by name")
        axes = {
            name: axis_of(axis, f"randomise {name} of task {self.name}") if isinstance(axis, Mapping) else axis
            for name, axis in self.randomise.items()
        }
        self._set("randomise", axes)

    def _read_numbers(self) -> None:
        """Numbers in their ranges, as floats."""
        for name, (low, high), unit in (
            ("speed_limit", arguments.SPEEDS, "µm/s"),
            ("rate", arguments.RATES, "Hz"),
            ("time_limit", arguments.TIME_LIMITS, "s"),
        ):
            self._set(name, arguments.within(self._of(name), getattr(self, name), low, high, unit))
        self._set("power", arguments.powers(self._of("power"), self.power))
        self._set("choices", arguments.rows(self._of("choices"), self.choices))
        if self.goal is not None:
            self._set("goal", arguments.triple(self._of("goal"), self.goal))
        self._set("goal_half", arguments.triple(self._of("goal_half"), self.goal_half, least=0.0))

    def _check_kinds(self) -> None:
        """Words, truth values, and the sizes of images."""
        for name, allowed in (("action", get_args(ActionKind)), ("observation", get_args(Observation))):
            if getattr(self, name) not in allowed:
                raise InputError(f"{self._of(name)} is {getattr(self, name)!r}; allowed: {', '.join(allowed)}")
        for name in ("power_each", "image_follows"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise InputError(f"{self._of(name)} is {getattr(self, name)!r}; allowed: True, False")
        if self.expert is not None and not callable(self.expert):
            raise InputError(
                f"{self._of('expert')} is {self.expert!r}; allowed: a function that makes a policy, or None"
            )
        size = self.image_size if isinstance(self.image_size, tuple | list) else ()
        if len(size) != 2 or not all(_counts(n, MOST_PIXELS) for n in size):
            allowed = f"two whole numbers from 1 to {MOST_PIXELS}"
            raise InputError(f"{self._of('image_size')} is {self.image_size!r}; allowed: {allowed}")
        self._set("image_size", (int(size[0]), int(size[1])))
        if not _counts(self.image_binning, MOST_BINNED):
            raise InputError(f"{self._of('image_binning')} is {self.image_binning!r}; "
                             f"allowed: a whole number from 1 to {MOST_BINNED}")  # fmt: skip
        self._set("image_binning", int(self.image_binning))

    def _check_terms(self) -> None:
        """Terms are what they are used for, and have names of their own."""
        for kind, terms, wanted in (
            ("observation", self.observations, ("vector", "number")),
            ("reward", self.rewards, ("number",)),
            ("end", self.ends, ("truth",)),
        ):
            names = [t.name for t in terms]
            for t in terms:
                if t.result not in wanted:
                    raise InputError(f"{kind} {t.name} of task {self.name} is a {t.result}; allowed: {wanted[0]}")
                if names.count(t.name) > 1:
                    raise InputError(f"task {self.name} has two {kind}s {t.name}; allowed: {t.name}(name=…)")

    def _of(self, name: str) -> str:
        """An argument as messages name it."""
        return f"{name} of task {self.name}"

    def _set(self, name: str, value: Any) -> None:
        """Keep an argument as it was read."""
        object.__setattr__(self, name, value)

    def load(self) -> Scene:
        """Its scene.

        Raises:
            InputError: As `Scene.load`.
        """
        return self.scene if isinstance(self.scene, Scene) else Scene.load(self.scene)


def check_task(task: Any) -> None:
    """Refuse what is no task.

    Raises:
        InputError: It is none.
    """
    if not isinstance(task, Task):
        raise InputError(f"task is {task!r}; allowed: a Task, as task_of('otwarp/Navigate-v0') and from_scene make it")


def _check_text(name: str, value: Any) -> None:
    if not isinstance(value, str) or not value:
        raise InputError(f"{name} is {value!r}; allowed: a text")


def _counts(value: Any, most: int) -> bool:
    """Whether it is a whole number from 1 to `most`."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and 1 <= int(value) <= most
