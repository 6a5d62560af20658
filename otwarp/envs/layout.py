"""What the numbers of a task's observations and actions are, and how terms and hands become arrays of numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from otwarp.envs.kernels.control import HandData
from otwarp.envs.kernels.judge import NumberData, Reading, judge_kernels
from otwarp.envs.kernels.observe import observe_kernel
from otwarp.envs.kernels.specialise import finds_gap, for_shapes, gap_parameters
from otwarp.envs.task import Task
from otwarp.envs.terms import OWNERS, Term
from otwarp.errors import InputError
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.scene import Scene
from otwarp.simulation.packing.arrays import device_array


@dataclass(frozen=True)
class Column:
    """One number of an observation or action.

    Attributes:
        name: Of the term or hand, with the axis.
        unit: Of what it stands for.
        scale: What 1 stands for, in that unit.
        meaning: In one sentence.
    """

    name: str
    unit: str
    scale: float
    meaning: str


class Layout:
    """A task with the indices of its scene.

    Args:
        task: The task.
        scene: Its scene.

    Attributes:
        seen: Columns of an observation.
        acted: Columns of an action.
        axis: (T, 3) number of an action that moves a trap along x, y, z, -1 none.
        power: (T) number of an action that sets a trap's power, -1 none.
        hand: (T) hand of each trap, -1 none.

    Raises:
        InputError: A hand or term names what the scene does not have.
    """

    def __init__(self, task: Task, scene: Scene):
        self.task, self.scene = task, scene
        self.seen = [column for term in task.observations for column in _columns(term)]
        traps = [trap.prim for trap in scene.traps]
        self.axis = np.full((len(traps), 3), -1, dtype=np.int32)
        self.power, self.hand = np.full(len(traps), -1, dtype=np.int32), np.full(len(traps), -1, dtype=np.int32)
        self.acted: list[Column] = []
        #: columns of each hand's own numbers
        self.of_hand: list[list[int]] = []
        for n, hand in enumerate(task.hands):
            own = [_trap(task, hand.name, prim, traps) for prim in hand.traps]
            if not own or np.any(self.hand[own] >= 0):
                raise InputError(f"hand {hand.name} of task {task.name}: allowed: traps that no other hand has")
            self.hand[own] = n
            first = len(self.acted)
            self._add_hand(n, own)
            self.of_hand.append(list(range(first, len(self.acted))))
        width = len(self.acted)
        if task.choices and any(len(row) != width for row in task.choices):
            raise InputError(f"choices of task {task.name} have rows of another length; allowed: {width} numbers each")

    @property
    def moves(self) -> bool:
        """Whether actions move traps."""
        return bool(np.any(self.axis >= 0))

    def _add_hand(self, n: int, traps: list[int]) -> None:
        """Append the numbers of a hand."""
        task, hand = self.task, self.task.hands[n]
        if task.action in ("velocity", "both"):
            if not hand.axes or any(a not in "xyz" or hand.axes.count(a) > 1 for a in hand.axes):
                raise InputError(f"hand {hand.name} of task {task.name} moves along {hand.axes!r}; "
                                 "allowed: some of x, y, z, each once")  # fmt: skip
            for a in hand.axes:
                self.axis[traps, "xyz".index(a)] = len(self.acted)
                what = f"velocity of the traps of {hand.name} along {a}; a longer vector counts as one of length 1"
                self.acted.append(Column(f"{hand.name}.velocity.{a}", "µm/s", task.speed_limit, what))
        if task.action in ("power", "both"):
            low, high = task.power
            groups = [[t] for t in traps] if task.power_each else [traps]
            for group in groups:
                self.power[group] = len(self.acted)
                which = self.scene.traps[group[0]].prim.rsplit("/", 1)[-1] if task.power_each else "its traps"
                name = f"{hand.name}.power" + (f".{which}" if task.power_each else "")
                what = f"power of {which}, from {low:g} mW at -1 to {high:g} mW at 1"
                self.acted.append(Column(name, "mW", (high - low) / 2, what))

    def slices(self) -> dict[str, slice]:
        """Columns of each observed term."""
        found, first = {}, 0
        for term in self.task.observations:
            width = len(term.components) or 1
            found[term.name] = slice(first, first + width)
            first += width
        return found

    @property
    def _shapes(self) -> tuple[str, ...]:
        """Shapes of the scene's obstacles, for which terms are made."""
        return tuple(sorted({o.shape for o in self.scene.obstacles})) or ("plane",)

    def _aimed(self, terms: tuple[Term, ...]) -> tuple[WorldFunction, ...]:
        """The functions of terms for these shapes, on the bodies and traps of the scene."""
        made = [for_shapes(t.function.function, self._shapes, self._gaps_known(t)) for t in terms]
        return tuple(
            replace(t.function, function=f, whole=t.whole(self.scene)) for t, f in zip(terms, made, strict=True)
        )

    def _seen(self) -> tuple[tuple[Reading, ...], tuple[str, ...], bool]:
        """What is observed, the shapes for which, and whether a gap is among it."""
        terms = self.task.observations
        seen = zip(self._aimed(terms), terms, strict=True)
        readings = tuple(Reading(function, t.components) for function, t in seen)
        return readings, self._shapes, any(finds_gap(t.function.function) for t in terms)

    def kernels(self) -> tuple[wp.Kernel, wp.Kernel]:
        """What judges periods and starts worlds anew, compiled for the indices of the terms and the shapes."""
        readings, shapes, gaps_seen = self._seen()
        return judge_kernels(readings, self._aimed(self.task.rewards), self._aimed(self.task.ends), shapes, gaps_seen)

    def observe_kernel(self) -> wp.Kernel:
        """What observes worlds and does nothing else."""
        return observe_kernel(*self._seen())

    def _bodies_named(self, term: Term) -> dict[str, int]:
        """Bodies that the parameters of a term name, by parameter."""
        names = [name for name, kind in zip(term.values, term.function.kinds, strict=True) if kind is int]
        indices = zip(names, term.whole(self.scene), strict=True)
        return {name: index for name, index in indices if OWNERS.get(name) == "bodies"}

    def _gaps_known(self, term: Term) -> bool:
        """Whether `watched` has all bodies whose gaps a term asks for."""
        asked = gap_parameters(term.function.function)
        return asked is not None and set(asked) <= set(self._bodies_named(term))

    def watched(self) -> list[int]:
        """Bodies of which terms ask for the gap from obstacles, as far as they name them."""
        task = self.task
        terms = [t for t in (*task.observations, *task.rewards, *task.ends) if finds_gap(t.function.function)]
        return sorted({index for t in terms for index in self._bodies_named(t).values()})

    def numbers(self, device: wp.Device) -> Any:
        """`NumberData`: parameters, scales and weights."""
        task, data = self.task, NumberData()

        def row(values: list[float], kind: Any = wp.float32) -> wp.array:
            return device_array(np.array(values or [0.0], dtype=float)[None], kind, device, ndim=2)

        data.seen = row([v for t in task.observations for v in t.row(self.scene)])
        data.earned = row([v for t in task.rewards for v in t.row(self.scene)])
        data.ended = row([v for t in task.ends for v in t.row(self.scene)])
        data.scale = row([column.scale for column in self.seen])
        data.weight = row([t.weight for t in task.rewards])
        data.success = row([float(t.success) for t in task.ends], wp.int32)
        return data

    def hands(self, device: wp.Device) -> Any:
        """`HandData`."""
        data = HandData()
        data.axis = device_array(self.axis, wp.int32, device, ndim=2)
        data.power = device_array(self.power, wp.int32, device)
        return data


def _columns(term: Term) -> list[Column]:
    """Columns of a term."""
    if not term.components:
        return [Column(term.name, term.unit, term.scale, term.told)]
    return [Column(f"{term.name}.{'xyz'[c]}", term.unit, term.scale, term.told) for c in term.components]


def _trap(task: Task, hand: str, prim: str, traps: list[str]) -> int:
    if prim not in traps:
        raise InputError(f"hand {hand} of task {task.name} has the trap {prim}; allowed: {', '.join(traps) or 'none'}")
    return traps.index(prim)
