"""`EscapeStudy`: rates of escapes that are too rare to be waited for, over the points of a study."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.options import StepOptions
from otwarp.studies.any_study import Read
from otwarp.studies.asked import asked_by
from otwarp.studies.design import blocks
from otwarp.studies.engines.memory import rough_worlds
from otwarp.studies.observables import first_passage
from otwarp.studies.plan import PER_POINT, steps_of_points
from otwarp.studies.rare.compute import Found, own_step_counts, rates_at
from otwarp.studies.rare.layout import PILOT, SLOTS
from otwarp.studies.rare.orders import Order, distance, order_of
from otwarp.studies.rare.placement import MOST, rounded
from otwarp.studies.stopping.rules import trials
from otwarp.studies.store import Variable
from otwarp.studies.study import Study

METHODS = ("forward-flux", "splitting")
"""How escapes are found: forward-flux sampling, or adaptive multilevel splitting."""

SHARES = {"forward-flux": 0.3, "splitting": 0.7}
"""Share of the paths that is to come from one level to the next, where nobody says."""


@dataclass(frozen=True, kw_only=True)
class EscapePlan:
    """What running a study of escapes means, before anything runs.

    Attributes:
        points, groups: Combinations of values, and how many models they need.
        blocks: Tasks, each one chunk of the store.
        runs: Independent estimates of each point.
        branches: Paths side by side in each.
        time_step, longest_step: The smallest and the largest of any point [s].
        bytes: Of the results, uncompressed.
        grouped_by: Axes whose values need models of their own.
    """

    points: int
    groups: int
    blocks: int
    runs: int
    branches: int
    time_step: float
    longest_step: float
    bytes: int
    grouped_by: tuple[str, ...] = ()


class EscapeStudy(Study):
    """Rates of escape at many points, each by independent runs of forward-flux sampling or of splitting.

    A trial of the study is a run: a flux out of the basin, and the probability to escape before coming back. An escape
    is that of the engine, a trap that has lost its sphere.

    Args:
        scene: A scene as it was loaded from a file, its file, or the name of a shipped one.
        axes: What varies, as for `Study`.
        order: How far a world has come; `ot.distance()` unless another is given.
        interfaces: Values of it, increasing, between the basin and the escape; None: pilot runs place them.
        basin: Below which value a world has come back; None: half of the time it is there.
        method: `forward-flux` or `splitting`, which needs no interfaces behind the first.
        runs: Independent runs of each point, from whose spread the interval follows.
        branches: Paths of a run that start from each interface.
        crossing: Share of them that is to come to the next; None: 0.3, or for splitting 0.7.
        relax: After what time paths have forgotten their start [s]; None: found by pilot runs.
        every: Time steps from look to look at the order parameter; escapes are seen in every step.
        halved: Whether all is done again with half the time step.
        level: Of the intervals.
        seed, horizon, time_step, options: As for `Study`. Where traps or obstacles move, paths begin in the first half
            of the horizon and must end within it; every point takes the step that it needs unless one is given.

    Raises:
        InputError: Anything that is not allowed, in one line.

    Example:
        >>> study = ot.EscapeStudy(scene, axes={"trap_power": ot.grid(0.01, 0.1, 8, unit="mW")}, runs=16, seed=7)
        >>> table = study.run("out/escape")
    """

    kind = "escape"
    side_by_side = False

    def __init__(
        self,
        scene: Scene | str | Path,
        *,
        axes: Mapping[Any, Any] | None = None,
        order: Order | Any = None,
        interfaces: Sequence[float] | None = None,
        basin: float | None = None,
        method: str = "forward-flux",
        runs: int = 16,
        branches: int = 1000,
        crossing: float | None = None,
        relax: float | None = None,
        every: int = 2,
        halved: bool = True,
        level: float = 0.95,
        seed: int = 0,
        horizon: float | None = None,
        time_step: float | str | None = PER_POINT,
        options: StepOptions | None = None,
    ):
        for name, value, least in (("runs", runs, 2), ("branches", branches, 16), ("every", every, 1)):
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise InputError(f"{name} is {value!r}; allowed: a whole number, {least} or more")
        if method not in METHODS:
            raise InputError(f"method is {method!r}; allowed: {', '.join(METHODS)}")
        self.method, self.runs, self.branches, self.every, self.halved = method, runs, branches, every, bool(halved)
        self.crossing = SHARES[method] if crossing is None else _between("crossing", crossing, 0.05, 0.95)
        self.relax = None if relax is None else _between("relax", relax, 0.0, np.inf)
        self.order = distance() if order is None else order_of(order)
        self.interfaces, self.basin = _levels(self.order, interfaces, basin)
        super().__init__(
            scene,
            axes=axes,
            observables=[first_passage()],
            stop=trials(runs, level=level),
            seed=seed,
            horizon=horizon,
            time_step=time_step,
            options=options,
        )
        self.order.values_in(self.design.scene)
        most = 2**32 // (SLOTS * max(branches, PILOT) * (runs + 1))
        if self.design.points > most:
            raise InputError(f"the study has {self.design.points} points of {runs} runs with {branches} branches; "
                             f"allowed: up to {most} such points")  # fmt: skip

    @property
    def step_counts(self) -> np.ndarray:
        """(points) steps of each point over the horizon: what its own powers ask for, where no step is given."""
        if self._step_counts is None:
            own = self.asked_step == PER_POINT
            self._step_counts = own_step_counts(self) if own else steps_of_points(self, self.asked_step)
        return self._step_counts

    def plan(self) -> EscapePlan:
        """What running it means; nothing is simulated."""
        counts, design = self.step_counts, self.design
        per_run = 8 * (4 + (2 if self.halved else 1) * MOST)
        return EscapePlan(
            points=design.points,
            groups=len(design.groups(np.arange(design.points))),
            blocks=len(self.blocks()),
            runs=self.runs,
            branches=self.branches,
            time_step=self.horizon / int(counts.max()),
            longest_step=self.horizon / int(counts.min()),
            bytes=design.points * (8 * MOST + self.runs * per_run),
            grouped_by=design.grouped_by,
        )

    def at_once(self, worlds: int) -> int:
        """Paths that run at once: whole runs, or the pilot.

        Args:
            worlds: As many as there is memory for.
        """
        return max(PILOT, self.branches * max(1, min(self.runs, worlds // self.branches)))

    def blocks(self) -> list[tuple[slice, ...]]:
        """Every point is a block: kept as soon as it is known."""
        return blocks(self.design.shape, 1)

    def asked(self) -> dict[str, Any]:
        """What the store says of the study: equal for equal studies, and only for them."""
        said = asked_by(self)
        observed = {"name": "escape_rate", "kind": "escape", "unit": "1/s"}
        how = {
            "order": self.order.described(),
            "interfaces": None if self.interfaces is None else self.interfaces.tolist(),
            "basin": self.basin,
            "method": self.method,
            "branches": self.branches,
            "crossing": self.crossing,
            "relax": self.relax,
            "every": self.every,
            "halved": self.halved,
        }
        del said["every"]
        return {"kind": self.kind, **said, "observables": [observed], "escape": how}

    def variables(self, dims: tuple[str, ...]) -> tuple[dict[str, Variable], dict[str, int]]:
        """Arrays of results, and the lengths of their dimensions beside those of the axes, `dims`."""
        run, unit = (*dims, "trial"), {"units": self.order.unit} if self.order.unit else {}
        per = {"units": "1/s"}
        found = {
            "trials": Variable(dims, "i4", -1, {"long_name": "runs, -1: not computed"}),
            "end": Variable(run, "i1", -128, {"long_name": "1 escapes seen, 0 none, -1 a fault"}),
            "basin": Variable(dims, "f8", np.nan, unit | {"long_name": "end of the basin"}),
            "interface_at": Variable((*dims, "interface"), "f8", np.nan, unit | {"long_name": "interfaces"}),
            "relax": Variable(dims, "f8", np.nan, {"units": "s", "long_name": "time before anything counts"}),
        }
        for name in ("", "_halved") if self.halved else ("",):
            said = ", half the step" if name else ""
            found |= {
                f"flux{name}_of_trial": Variable(
                    run, "f8", np.nan, per | {"long_name": f"flux out of the basin{said}"}
                ),
                f"probability{name}_of_trial": Variable(
                    (*run, "interface"), "f8", np.nan, {"long_name": f"probability to come to the next interface{said}"}
                ),
                f"rate{name}_of_trial": Variable(run, "f8", np.nan, per | {"long_name": f"rate of escapes{said}"}),
                f"steps{name}_of_trial": Variable(run, "i8", -1, {"long_name": f"world-steps{said}"}),
            }
        return found, {"trial": self.runs, "interface": MOST}

    def start(
        self,
        numbers: Sequence[int],
        *,
        device: str,
        threads: int | None = None,
        worlds: int | None = None,
        unwanted: threading.Event | None = None,
    ) -> Read:
        """As `Study.start`, one block after the other; all is computed, as each stage of a run hangs on the one before.

        Args:
            numbers: Of the blocks.
            device: Where.
            threads: On a CPU.
            worlds: Paths that run at once, at most, but for those of one run; None: as many as there is memory for.
                Results do not depend on it.
            unwanted: Says to another thread that nobody wants the blocks any more; it is looked at before every look.

        Raises:
            CancelledError: `unwanted` was set meanwhile.
        """
        worlds = worlds or rough_worlds(self.design.scene, self.options.precision, device)
        every = np.arange(self.design.points).reshape(self.design.shape)
        out: list[Found] = []
        for where in (self.blocks()[n] for n in numbers):
            (point,) = every[where].ravel() if self.design.shape else (0,)
            found = rates_at(self, int(point), worlds=worlds, device=device, threads=threads, unwanted=unwanted)
            shape = every[where].shape
            out.append({name: values.reshape((*shape, *values.shape)) for name, values in found.items()})
        return lambda: out


def _between(name: str, value: Any, low: float, high: float) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not low < value < high:
        allowed = f"above {low:g}" + (f" and below {high:g}" if np.isfinite(high) else "")
        raise InputError(f"{name} is {value!r}; allowed: {allowed}")
    return float(value)


def _levels(
    order: Order, interfaces: Sequence[float] | None, basin: float | None
) -> tuple[np.ndarray | None, float | None]:
    """Interfaces and the end of the basin, as the device compares them."""
    real = isinstance(basin, int | float | np.integer | np.floating) and not isinstance(basin, bool)
    if basin is not None and not (real and np.isfinite(basin)):
        raise InputError(f"basin is {basin!r}; allowed: a finite {order.name}")
    if interfaces is None:
        return None, None if basin is None else float(rounded(basin))
    try:
        found = rounded(np.asarray(interfaces, dtype=float))
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if (
        found.ndim != 1
        or not 1 <= len(found) <= MOST
        or not np.all(np.isfinite(found))
        or np.any(np.diff(found) <= 0.0)
    ):
        raise InputError(
            f"interfaces are {list(np.ravel(interfaces))}; allowed: 1 to {MOST} finite values that increase"
        )
    if basin is not None and not basin <= found[0]:
        raise InputError(f"basin is {basin:g}, beyond the first interface; allowed: up to {found[0]:g}")
    return found, None if basin is None else float(rounded(basin))
