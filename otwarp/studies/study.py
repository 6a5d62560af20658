"""`Study`: what varies, what is asked, how many trials; planned, run and read."""

from __future__ import annotations

import dataclasses
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.kernels.core.functions import digest_of
from otwarp.scene import Scene
from otwarp.scene.digest import scene_digest
from otwarp.scene.read.variations import Variations
from otwarp.simulation.ends import End
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.studies import store as stores
from otwarp.studies.axes import Scatter, dimensions
from otwarp.studies.design import Design, blocks
from otwarp.studies.observables import Observable, OfScene
from otwarp.studies.runner import Outcomes, Runner, parameter_rows
from otwarp.studies.stopping import Stop
from otwarp.studies.targets import Target, target_of

BLOCK_TRIALS = 2**14
"""Trials of a block of points, at most: what is kept when something ends a study, and one chunk of its store."""

LOOKS = 50
"""Times that the worlds are looked at within the horizon where nothing else is said."""

SAMPLE = 256
"""Points of a group, evenly chosen, whose time scales say which step all of it can take."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What running a study means, before anything runs.

    Attributes:
        points, groups: Combinations of values, and how many models they need.
        blocks: Tasks, each one chunk of the store.
        trials: Least and largest number of trials.
        time_step: Of all of them [s].
        steps: World-steps, at most.
        estimated: Errors of what is observed that the step leaves, by name.
        bytes: Of the results, uncompressed.
        scatter: Of which parameters.
    """

    points: int
    groups: int
    blocks: int
    trials: tuple[int, int]
    time_step: float
    steps: int
    bytes: int
    horizon: float


class Study:
    """A batched study of a scene.

    Args:
        scene: A scene that was loaded from a file, or its file.
        axes: What varies: name (see `otwarp.studies.targets`) → `grid`, `values`, `random`, `normal` or `sobol`; a
            tuple of names → as many, which go together.
        observables: What is asked of every trial.
        stop: How many trials a point gets.
        seed: Key of all random numbers, 0 to 2³² − 1.
        horizon: How long a trial goes on at most [s]; None: the latest `until`, or the scene's duration.
        every: Time between looks at the worlds [s], to which all but escapes is known; None: a fiftieth of the horizon.
        time_step: For all points [s]; None: the largest that every point can take.
        scatter: What varies from trial to trial: name of a parameter → `Scatter`.
        options: What else is chosen about the step.

    Raises:
        InputError: Anything that is not allowed, in one line.

    Example:
        >>> study = ot.Study(scene, axes={"trap_power": ot.grid(0.1, 5, 32, unit="mW")},
        ...                  observables=[ot.trapped(until=1.0)], stop=ot.half_width(0.01), seed=7)
        >>> table = study.run("out/capture")
    """

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
        time_step: float | None = None,
        scatter: Mapping[str, Scatter] | None = None,
        options: StepOptions | None = None,
    ):
        file = scene.file if isinstance(scene, Scene) else Path(scene)
        if file is None:
            raise InputError(
                "the scene of a study has no file; allowed: a scene that was loaded, SceneBuilder saves one"
            )
        variations = Variations(file)
        loaded = scene if isinstance(scene, Scene) else variations.scene({})
        self.seed = _whole("seed", seed, 0, 2**32 - 1)
        self.design = Design.of(loaded, variations, dimensions(axes or {}))
        if self.design.grouped and loaded != variations.scene({}):
            raise InputError(
                f"the scene is not that of its file {file}; allowed beside axes of attributes or speeds: as it was read"
            )
        self.observables = _observables(observables, loaded)
        self.stop = stop or Stop()
        self.options = options or StepOptions()
        self.scatter = tuple((_scattered(n, s, loaded, variations), s) for n, s in (scatter or {}).items())
        self.horizon = self._horizon(horizon)
        self._every, self._time_step = every, time_step
        self._runner: Runner | None = None
        if self.design.points * self.stop.at_most > 2**32:
            raise InputError(f"the study has up to {self.design.points * self.stop.at_most} trials; allowed: up to 2³²")

    def _horizon(self, horizon: float | None) -> float:
        latest = max((o.until for o in self.observables if o.until is not None), default=None)
        found = (
            horizon if horizon is not None else latest if latest is not None else self.design.scene.settings.duration
        )
        if not (isinstance(found, int | float) and np.isfinite(found) and found > 0.0):
            raise InputError(f"horizon is {found!r}; allowed: a time above 0 s")
        if latest is not None and found < latest:
            raise InputError(
                f"horizon is {found:g} s; allowed: {latest:g} s or more, the latest until of an observable"
            )
        return float(found)

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
            step = self._step()
            steps = max(1, round(self.horizon / step))
            every = max(1, round((self._every or self.horizon / LOOKS) / step))
            self._runner = Runner(
                seed=self.seed,
                time_step=step,
                steps=steps,
                every=every,
                ends=self.ends,
                numbers=tuple(o for o in self.observables if o.kind == "number"),
                scatter=self.scatter,
                options=self.options,
            )
        return self._runner

    def _step(self) -> float:
        """The largest step that is a whole part of the horizon and that every point can take."""
        if self._time_step is not None:
            return self.horizon / max(1, round(self.horizon / self._time_step))
        smallest = np.inf
        for points, values in self.design.groups(np.arange(self.design.points)):
            scene = self.design.scene_of(values)
            sample = points[np.unique(np.linspace(0, len(points) - 1, min(len(points), SAMPLE)).astype(int))]
            origin = Model.build(scene, device="cpu", options=self.options)
            rows = parameter_rows(origin, self._worst(origin, self.design.at(sample)), len(sample))
            model = Model.build(scene, worlds=len(sample), device="cpu", parameters=rows, options=self.options)
            smallest = min(smallest, model.time_step)
        return self.horizon / int(np.ceil(self.horizon / smallest))

    def _worst(self, origin: Model, values: dict[Target, np.ndarray]) -> dict[Target, np.ndarray]:
        """Parameters of points, those that scatter four deviations above where they are."""
        return values | {
            t: (1.0 + 0.04 * s.deviation) * v
            for t, s in self.scatter
            if s.unit == "%" and (v := values.get(t)) is not None
        }

    def plan(self) -> Plan:
        """What running it means; nothing is simulated."""
        design, runner = self.design, self.runner
        least = self.stop.at_most if self.stop.half_width is None else self.stop.at_least
        per_trial = 5 + 4 * len(runner.numbers)
        return Plan(
            points=design.points,
            groups=len(design.groups(np.arange(design.points))),
            blocks=len(self.blocks()),
            trials=(least * design.points, self.stop.at_most * design.points),
            time_step=runner.time_step,
            horizon=self.horizon,
            steps=self.stop.at_most * design.points * runner.steps,
            bytes=design.points * (4 + self.stop.at_most * per_trial),
        )

    def blocks(self) -> list[tuple[slice, ...]]:
        """Blocks of points, each kept as a whole; a study of one point has one."""
        return blocks(self.design.shape, max(1, BLOCK_TRIALS // self.stop.at_most))

    @property
    def points_of_a_block(self) -> int:
        """Points of the first block, which has as many as any."""
        return int(np.prod([s.stop - s.start for s in self.blocks()[0]], dtype=np.int64))

    def asked(self) -> dict[str, Any]:
        """What the store says of the study: equal for equal studies, and only for them."""
        import warp

        import otwarp

        axes = {
            d.name: {name: {"values": axis.values.tolist(), "unit": axis.unit} for name, axis in d.columns.items()}
            for d in self.design.dimensions
        }
        runner = self.runner
        return {
            "version": stores.VERSION,
            "scene": {"file": str(self.design.scene.file), "sha256": scene_digest(self.design.scene)},
            "axes": axes,
            "observables": [described(o) for o in self.observables],
            "stop": dataclasses.asdict(self.stop),
            "scatter": {t.name: dataclasses.asdict(s) for t, s in self.scatter},
            "seed": self.seed,
            "blocks": len(self.blocks()),
            "horizon": self.horizon,
            "time step": runner.time_step,
            "every": runner.every * runner.time_step,
            "options": {
                "integrator": self.options.integrator or self.design.scene.settings.integrator,
                "noise": self.options.noise or self.design.scene.settings.noise,
                "precision": self.options.precision,
                "fast math": self.options.fast_math,
                "forces": [f.body_force.name for f in self.options.forces],
            },
            "versions": {"otwarp": otwarp.__version__, "warp": warp.__version__, "python": platform.python_version()},
        }

    def compute(
        self, numbers: Sequence[int], *, device: str, threads: int | None = None, worlds: int = 2**20
    ) -> list[dict[str, np.ndarray]]:
        """Compute blocks side by side: of each its arrays by the names of the store.

        Args:
            numbers: Of the blocks.
            device: Where.
            threads: On a CPU.
            worlds: Trials that run at once, at most; results do not depend on it.
        """
        all_points = np.arange(self.design.points).reshape(self.design.shape)
        own = [all_points[where] for where in (self.blocks()[n] for n in numbers)]
        points = np.concatenate([p.ravel() for p in own])
        most, runner = self.stop.at_most, self.runner
        done = np.zeros(len(points), dtype=np.int64)
        code = np.full((len(points), most), -128, dtype=np.int8)
        time = np.full((len(points), most), np.nan, dtype=np.float32)
        kept = np.full((len(points), most, len(runner.numbers)), np.nan, dtype=np.float32)
        while True:
            wanted = self.stop.wanted(self._successes(code, time, done), done)
            if np.all(wanted <= done):
                break
            more = wanted - done
            which = np.repeat(np.arange(len(points)), more)
            nth = np.arange(len(which)) - np.repeat(np.cumsum(more) - more, more) + done[which]
            for start in range(0, len(which), worlds):
                part = slice(start, start + worlds)
                out = self._run(points[which[part]], nth[part], device, threads)
                at = which[part], nth[part]
                code[at], time[at], kept[at] = out.code, out.time, out.numbers
            done = wanted
        found = {"trials": done.astype(np.int32), "end": code, "end_time": time}
        found |= {f"{o.name}_of_trial": kept[..., n] for n, o in enumerate(runner.numbers)}
        cuts = np.cumsum([p.size for p in own])[:-1]
        parts = {name: np.split(values, cuts) for name, values in found.items()}
        return [
            {name: part[n].reshape(*p.shape, *part[n].shape[1:]) for name, part in parts.items()}
            for n, p in enumerate(own)
        ]

    def _run(self, points: np.ndarray, nth: np.ndarray, device: str, threads: int | None) -> Outcomes:
        """Trials of points, group by group."""
        order = np.arange(len(points))
        code, time = np.empty(len(points), np.int8), np.empty(len(points))
        numbers = np.empty((len(points), len(self.runner.numbers)), np.float32)
        for own, values in self.design.groups(np.unique(points)):
            mine = order[np.isin(points, own)]
            at = {t: v for t, v in self.design.at(points[mine]).items() if not t.grouped}
            trial = points[mine].astype(np.int64) * self.stop.at_most + nth[mine]
            out = self.runner.run(self.design.scene_of(values), at, trial, device=device, threads=threads)
            code[mine], time[mine], numbers[mine] = out.code, out.time, out.numbers
        return Outcomes(code=code, time=time, numbers=numbers)

    def _successes(self, code: np.ndarray, time: np.ndarray, done: np.ndarray) -> np.ndarray:
        """(k, n) how often each probability's event was seen."""
        ran = np.arange(code.shape[-1]) < done[..., None]
        rows = [
            np.sum(happened(o, code, time, self.ends) & ran, axis=-1)
            for o in self.observables
            if o.kind == "probability"
        ]
        return np.array(rows).reshape(len(rows), len(done))


def happened(o: Observable, code: np.ndarray, time: np.ndarray, ends: Sequence[End]) -> np.ndarray:
    """Whether trials count for a probability; a trial with a fault counts for none."""
    assert o.end is not None
    number = 1 + next(n for n, end in enumerate(ends) if same_end(o.end, end))
    came = (code == number) & (time <= (np.inf if o.until is None else o.until))
    return came if o.happens else ~came & (code >= 0)


def same_end(a: End, b: End) -> bool:
    """Whether two ends are one: the same predicate with the same parameters."""
    same = a.predicate == b.predicate and a.values.keys() == b.values.keys()
    return same and all(np.array_equal(np.asarray(v), np.asarray(b.values[k])) for k, v in a.values.items())


def described(o: Observable) -> dict[str, Any]:
    """What the store says of an observable."""
    said: dict[str, Any] = {"name": o.name, "kind": o.kind, "unit": o.unit}
    if o.end is not None:
        said |= {
            "end": o.end.name,
            "happens": o.happens,
            "until": o.until,
            "parameters": {k: np.asarray(v).tolist() for k, v in o.end.values.items()},
            "sha256": digest_of(o.end.predicate.function, o.end.name, o.end.predicate.kinds),
        }
    if o.function is not None:
        said |= {
            "keep": o.keep,
            "parameters": list(o.values),
            "sha256": digest_of(o.function.function, o.name, o.function.kinds),
        }
    return said


def _observables(given: Sequence[Any], scene: Scene) -> tuple[Observable, ...]:
    found: list[Observable] = []
    for item in given if isinstance(given, list | tuple) else [given]:
        made = item
        # `contact_force`, or `delivered` by the scene's own goal: what needs a scene, or nothing
        if isinstance(made, OfScene):
            made = made.made(scene)
        elif not isinstance(made, Observable) and callable(made):
            made = made()
        if not isinstance(made, Observable):
            raise InputError(f"observables hold {item!r}; allowed: trapped(until=…), first_passage(), … or one's own")
        found.append(made)
    names = [o.name for o in found]
    if not found or len(set(names)) < len(names):
        again = next((n for n in names if names.count(n) > 1), None)
        raise InputError(f"observables are {', '.join(names) or 'none'}; allowed: one or more"
                         f"{f', {again} once or under another name' if again else ''}")  # fmt: skip
    return tuple(found)


def _scattered(name: str, scatter: Any, scene: Scene, variations: Variations) -> Target:
    target = target_of(name, scene, variations)
    if not isinstance(scatter, Scatter) or target.kind != "parameter" or target.vector:
        raise InputError(f"scatter of {name} is {scatter!r}; allowed: Scatter of a parameter that is a number")
    return target


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not low <= value <= high:
        raise InputError(f"{name} is {value!r}; allowed: a whole number, {low} to {high}")
    return int(value)
