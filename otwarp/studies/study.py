"""`Study`: what varies, what is asked, how many trials; planned, run and read."""

from __future__ import annotations

import copy
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.read.variations import Variations
from otwarp.simulation.ends import End
from otwarp.simulation.options import StepOptions
from otwarp.studies.any_study import Read
from otwarp.studies.asked import asked_by
from otwarp.studies.axes import Scatter, dimensions
from otwarp.studies.compute import start_blocks
from otwarp.studies.design import Design, blocks, check_starts, cut_blocks
from otwarp.studies.differences import difference
from otwarp.studies.observables import check_observables, check_time, same_end
from otwarp.studies.plan import PER_POINT, Plan, plan_of, steps_of_points
from otwarp.studies.runner import Runner
from otwarp.studies.stopping.rules import Stop
from otwarp.studies.store import Variable
from otwarp.studies.targets import Target, target_of

BLOCK_TRIALS = 2**14
"""Trials of a block of points, at most: what is kept when something ends a study, and one chunk of its store."""

BLOCK_WORK = 2**28
"""Steps of a block's trials, each as often as the scene has spheres and rods for each obstacle and the liquid, at most:
2 to 10 s of a core, the same for a bead as for robots among pillars. A block has one point at least."""

MANY_BLOCKS = 64
"""Blocks for which larger ones are taken instead of more: a file costs the same time, however little it holds, and a
GPU computes trials sooner than a thread of the host makes a file for each 16,384 of them."""

LARGER = 4
"""Times that what such blocks may hold is more."""


class Study:
    """A batched study of a scene.

    Args:
        scene: A scene as it was loaded from a file, its file, or the name of a shipped one.
        axes: What varies: name (see `otwarp.studies.targets`) → `grid`, `values`, `random`, `normal` or `sobol`; a
            tuple of names → as many, which go together.
        observables: What is asked of every trial.
        stop: How many trials a point gets.
        seed: Key of all random numbers, 0 to 2³² − 1.
        horizon: How long a trial goes on at most [s]; None: the latest `until`, or the scene's duration.
        every: Time between looks at the worlds [s], to which all but escapes is known; None: a fiftieth of the horizon.
        time_step: For all points [s]; None: the largest that every point can take; `per point`: each its own.
        scatter: What varies from trial to trial: name of a parameter → `Scatter`.
        options: What else is chosen about the step.

    Attributes:
        round: (points) trials that each has before and after what is to be computed, in a round of spending a budget;
            None: the rule of each point decides.
        cut: Points of a block along each dimension, as a folder has them that was made before; None: as many as
            `BLOCK_TRIALS` and `BLOCK_WORK` allow.
        text: Of the file that described it, which its folder keeps; None: there was none.
        side_by_side: Whether a device computes several blocks in the time of one.

    Raises:
        InputError: Anything that is not allowed, in one line.

    Example:
        >>> study = ot.Study(scene, axes={"trap_power": ot.grid(0.1, 5, 32, unit="mW")},
        ...                  observables=[ot.trapped(until=1.0)], stop=ot.half_width(0.01), seed=7)
        >>> table = study.run("out/capture")
    """

    side_by_side = True

    def __init__(
        self,
        scene: Scene | str | Path,
        *,
        axes: Mapping[Any, Any] | None = None,
        observables: Sequence[Any],
        stop: Stop | None = None,
        seed: int = 0,
        horizon: float | None = None,
        every: float | None = None,
        time_step: float | str | None = None,
        scatter: Mapping[str, Scatter] | None = None,
        options: StepOptions | None = None,
    ):
        _check_kinds(scene, stop, scatter, options)
        file = scene.file if isinstance(scene, Scene) else shipped.find("scenes", scene)
        if file is None:
            raise InputError(
                "the scene of a study has no file; allowed: a scene that was loaded, SceneBuilder saves one"
            )
        variations = Variations(file)
        there = variations.scene({})
        loaded = scene if isinstance(scene, Scene) else there
        _check_as_read(loaded, _lasting(there, loaded))
        self.seed = _whole("seed", seed, 0, 2**32 - 1)
        self.stop = stop or Stop()
        self.design = Design.of(loaded, variations, self.stop.arranged(dimensions(axes or {})))
        if self.design.grouped:  # models of groups are made from the file, and last as long as it says
            _check_as_read(loaded, there)
        check_starts(self.design)
        self.observables = check_observables(observables, loaded)
        self.stop.check([o.name for o in self.observables if o.kind == "probability"], self.design.points)
        self.options = options or StepOptions()
        self.scatter = tuple((_scattered(n, s, loaded, variations), s) for n, s in (scatter or {}).items())
        self.horizon = self._horizon(horizon)
        self._every = None if every is None else check_time("every", every)
        self.asked_step = _step(time_step)
        self._runner: Runner | None = None
        self._step_counts: np.ndarray | None = None
        self.round: tuple[np.ndarray, np.ndarray] | None = None
        self.cut: tuple[int, ...] | None = None
        self.text: str | None = None
        if self.design.points * self.stop.at_most > 2**32:
            raise InputError(f"the study has up to {self.design.points * self.stop.at_most} trials; allowed: up to 2³²")

    def _horizon(self, horizon: float | None) -> float:
        latest = max((o.until for o in self.observables if o.until is not None), default=None)
        given = (
            horizon if horizon is not None else latest if latest is not None else self.design.scene.settings.duration
        )
        found = check_time("horizon", given)
        if latest is not None and found < latest:
            raise InputError(
                f"horizon is {found:g} s; allowed: {latest:g} s or more, the latest until of an observable"
            )
        return found

    @property
    def ends(self) -> tuple[End, ...]:
        """What may end a trial, each once."""
        found: list[End] = []
        for o in self.observables:
            if o.end is not None and not any(same_end(o.end, end) for end in found):
                found.append(o.end)
        return tuple(found)

    @property
    def runner(self) -> Runner:
        """How trials run; its time step is that of the point that needs the smallest.

        Raises:
            InputError: A scene of some point cannot be stepped, or nothing can escape in it.
        """
        if self._runner is None:
            steps = int(self.step_counts.max())
            self._runner = Runner(
                seed=self.seed,
                horizon=self.horizon,
                steps=steps,
                looks_every=self._every,
                ends=self.ends,
                numbers=tuple(o for o in self.observables if o.function is not None),
                scatter=self.scatter,
                options=self.options,
            )
        return self._runner

    @property
    def step_counts(self) -> np.ndarray:
        """(points) steps of each point over the horizon, fixed when the study is planned."""
        if self._step_counts is None:
            self._step_counts = steps_of_points(self, self.asked_step)
        return self._step_counts

    def plan(self) -> Plan:
        """What running it means; nothing is simulated."""
        return plan_of(self)

    def blocks(self) -> list[tuple[slice, ...]]:
        """Blocks of points, each kept as a whole; a study of one point has one."""
        if self.cut is not None:
            return cut_blocks(self.design.shape, self.cut)
        least, trials = self.stop.decided_together(self.design.shape), self.stop.at_most
        scene = self.design.scene
        elements = sum(len(b.spheres) + len(b.rods) for b in scene.bodies)
        work = trials * self.runner.steps * max(elements, 1) * (1 + len(scene.obstacles))
        size, larger = (max(least, min(n * BLOCK_TRIALS // trials, n * BLOCK_WORK // work)) for n in (1, LARGER))
        return blocks(self.design.shape, max(size, min(larger, self.design.points // MANY_BLOCKS)))

    def in_blocks(self, cut: tuple[int, ...]) -> Study:
        """This study in other blocks; results do not depend on it.

        Args:
            cut: Points of a block along each dimension.
        """
        part = copy.copy(self)
        part.cut = cut
        return part

    def between(self, before: np.ndarray, after: np.ndarray) -> Study:
        """This study, of which the trials of one round are to be computed: (points) before it, and after."""
        part = copy.copy(self)
        part.round = before, after
        return part

    @property
    def points_of_a_block(self) -> int:
        """Points of the first block, which has as many as any."""
        return int(np.prod([s.stop - s.start for s in self.blocks()[0]], dtype=np.int64))

    def asked(self) -> dict[str, Any]:
        """What the store says of the study: equal for equal studies, and only for them."""
        return asked_by(self)

    def variables(self, dims: tuple[str, ...]) -> tuple[dict[str, Variable], dict[str, int]]:
        """Arrays of results, and the lengths of their dimensions beside those of the axes, `dims`."""
        trial = (*dims, "trial")
        found = {
            "trials": Variable(dims, "i4", -1, {"long_name": "trials, -1: not computed"}),
            "end": Variable(trial, "i1", -128, {"long_name": "end that came first, from 1; 0 none, -1 a fault"}),
            "end_time": Variable(trial, "f4", np.nan, {"units": "s", "long_name": "when it came"}),
        }
        for o in self.runner.numbers:
            said = {"long_name": f"{o.name} of each trial, {o.keep}", **({"units": o.unit} if o.unit else {})}
            found[f"{o.name}_of_trial"] = Variable(trial, "f4", np.nan, said)
        return found, {"trial": self.stop.at_most}

    def compute(
        self, numbers: Sequence[int], *, device: str, threads: int | None = None, worlds: int | None = None
    ) -> list[dict[str, np.ndarray]]:
        """Compute blocks side by side: of each its arrays by the names of the store.

        In a round of spending a budget only the trials of that round, up to the most that a point has then.

        Args:
            numbers: Of the blocks.
            device: Where.
            threads: On a CPU.
            worlds: Trials that run at once, at most; None: as many as there is memory for. Results do not depend on it.
        """
        return self.start(numbers, device=device, threads=threads, worlds=worlds)()

    def start(
        self,
        numbers: Sequence[int],
        *,
        device: str,
        threads: int | None = None,
        worlds: int | None = None,
        unwanted: threading.Event | None = None,
    ) -> Read:
        """Give a device all of blocks, arguments as of `compute`, which waits for what this returns.

        A GPU that has room for as many trials again is still at the last of them then: it may be given other blocks
        before these are read, by another thread as well.

        Raises:
            CancelledError: `unwanted` was set meanwhile: it is looked at before steps are given.
        """
        how = {"device": device, "threads": threads, "worlds": worlds, "unwanted": unwanted}
        return start_blocks(self, numbers, **how)

    def run(self, folder: str | Path, **how: Any) -> Any:
        """Compute what is missing of the study in a folder, and give all of it as an `xarray.Dataset`.

        Args:
            folder: Gets the store; the same call goes on after whatever ended it.
            how: As `otwarp.studies.run_study` takes it: `devices`, `shard`, `progress`, `allow_version`.

        Raises:
            InputError: Another study is in the folder, another process runs it, or xarray or zarr is not installed.
            OSError: The disk is full; what was finished is kept.
        """
        from otwarp.studies.engines.run import run_study
        from otwarp.studies.results import table

        return table(run_study(self, folder, **how))


def _lasting(scene: Scene, other: Scene) -> Scene:
    """The scene with the length of the other's run, which whoever loads a scene may choose."""
    return replace(scene, settings=replace(scene.settings, duration=other.settings.duration))


def _check_as_read(scene: Scene, there: Scene) -> None:
    """Refuse a scene that was changed in Python: a study keeps its file, and makes variants from that.

    Args:
        scene: Of the study.
        there: What its file says.

    Raises:
        InputError: They differ; the message says in what first.
    """
    if scene == there:
        return
    where, file, now = difference(there, scene) or ("something", "one", "another")
    raise InputError(f"the scene is not that of its file {scene.file}: {where} is {file} there, {now} now; allowed: "
                     "as it was read, so save the changed one by SceneBuilder, or make the change an axis")  # fmt: skip


def _check_kinds(scene: Any, stop: Any, scatter: Any, options: Any) -> None:
    """Refuse arguments of a study that are of another kind.

    Raises:
        InputError: The first of them.
    """
    for name, value, kinds, allowed in (
        ("scene", scene, (Scene, str, Path), "a scene, the path of its file, or the name of a shipped one"),
        ("stop", stop, (Stop, type(None)), "a rule such as half_width(…) or trials(…)"),
        ("scatter", scatter, (Mapping, type(None)), "names of parameters with Scatter(…) for each, as a dict"),
        ("options", options, (StepOptions, type(None)), "StepOptions(…)"),
    ):
        if not isinstance(value, kinds):
            raise InputError(f"{name} is {value!r}; allowed: {allowed}")


def _scattered(name: str, scatter: Any, scene: Scene, variations: Variations) -> Target:
    if not isinstance(name, str):
        raise InputError(f"scatter of {name!r}; allowed: the name of a parameter")
    target = target_of(name, scene, variations)
    if not isinstance(scatter, Scatter) or target.kind != "parameter" or target.vector:
        raise InputError(f"scatter of {name} is {scatter!r}; allowed: Scatter of a parameter that is a number")
    return target


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not low <= value <= high:
        raise InputError(f"{name} is {value!r}; allowed: a whole number, {low} to {high}")
    return int(value)


def _step(given: Any) -> float | str | None:
    """A step as it may be asked for."""
    number = isinstance(given, int | float) and not isinstance(given, bool) and 0.0 < given < np.inf
    if given is not None and given != PER_POINT and not number:
        raise InputError(f"time step is {given!r}; allowed: a time above 0 s, or '{PER_POINT}'")
    return given
