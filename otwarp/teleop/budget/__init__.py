"""The reduced scene: measure the machine, and keep what it can run in time with the wall clock.

In this order, and no further than needed:

1. Everything stays if it fits. What is recorded or drawn costs the simulation nothing and is left alone.
2. Cells that no trap can reach in the session stop, the farthest first: those that a moving body may touch freeze,
   those that none can touch leave; if that is not enough the frozen ones leave as well. Robots, cells within reach, the
   cell of the goal and what a trap is meant to hold always stay.
3. The wanted accuracy is lowered, to `WORST_ERROR` at most; the time step that follows stays stable.
4. If even that does not fit, the session runs in slow motion, at the speed that fits, and says so.

What was lost to this is measured once more at its end: if the load of the machine has changed meanwhile, all of it is
done anew.

`reduce_scene` decides; `report` measures what a scene costs and says what was left out, `reach` which bodies the traps
can come to. `otwarp.teleop.session.pace` goes on looking while the session runs.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.composition import MAX_WORLD_BODIES
from otwarp.teleop.budget.reach import SWEEP, Reach, Thinned, thin_out
from otwarp.teleop.budget.report import FRAME_RATE, BudgetReport, Measure, SceneCost, measure_scene

AUTO_SHARE = 0.7
"""Share of one core that `auto` gives the simulation. The rest is for what the loop does besides, and for bodies that
come to touch each other later."""

WORST_ERROR = 0.05
"""Largest wanted error that the budget may lower the accuracy to [1]."""

CLOSE = 0.85
"""Load over the allowed share at which a candidate is full enough to end the search."""

TRIALS = 3
"""Measurements between the fewest bodies and all of them."""

WORTH = 0.9
"""Load over the former one up to which a loss is worth it where nothing fits: less gain is noise, or too dear."""

CHANGED = 1.25
"""Load of the same scene over its load before, or the other way round, from which on the machine's load has changed."""

SEARCHES = 3
"""Searches of a scene on a machine whose load keeps changing."""

LONGER = 1.02
"""Time step over the former one that makes a lower accuracy worth trying."""

LEAST_SHARE = 1e-9
"""Of a core, that may be asked for: with less nothing runs in real time."""

Budget = Literal["auto", "off"] | float
Progress = Callable[[str], None]
_Candidate = tuple[Thinned, SceneCost]


@dataclass(frozen=True, eq=False, kw_only=True)
class Reduced:
    """What the budget made of a scene.

    Attributes:
        scene: To be simulated, at `report.speed`.
        report: What was kept, frozen and dropped, and what that brought.
    """

    scene: Scene
    report: BudgetReport

    @property
    def speed(self) -> float:
        """Simulated seconds per second at which it fits."""
        return self.report.speed


def parse_budget(text: str | float) -> Budget:
    """`auto`, `off` or a share of a core, as typed after `--budget`.

    Raises:
        InputError: Anything else.
    """
    word = text.strip().lower() if isinstance(text, str) else text
    if word in ("auto", "off"):
        return word  # type: ignore[return-value]
    try:
        share = float(word)
    except ValueError:
        share = math.nan
    if not LEAST_SHARE <= share <= 1.0:
        raise InputError(f"budget is {text!r}; allowed: auto, off, or a share of a core from {LEAST_SHARE:g} to 1")
    return share


def reduce_scene(
    scene: Scene,
    *,
    device: str | None = None,
    budget: Budget | str = "auto",
    speed: float = 1.0,
    rate: float = FRAME_RATE,
    sweep: float = SWEEP,
    horizon: float | None = None,
    measure: Measure = measure_scene,
    progress: Progress | None = None,
) -> Reduced:
    """The largest part of a scene that runs at `speed` on this machine, and what was left out of it.

    Args:
        scene: As loaded.
        device: Where it will run.
        budget: `auto`, `off`, or the share of one core that the simulation may take, above 0 up to 1; as text, too.
        speed: Simulated seconds per second of wall time that are wanted.
        rate: Frames per second of wall time that are read out.
        sweep, horizon: How far a focus is moved [µm], and for how long the session lasts [s]; see `Reach.of`.
        measure: Says what a scene costs; replaced by tests.
        progress: Called with a line before each measurement, which may take the time to compile.

    Raises:
        InputError: An argument out of range, or a scene that cannot be simulated.
    """
    if not 0.0 < speed < math.inf:
        raise InputError(f"speed is {speed!r}; allowed: above 0 and finite")
    budget = parse_budget(budget)
    if budget == "off":
        return Reduced(scene=scene, report=BudgetReport.off(scene, speed))
    search = _Search(AUTO_SHARE if budget == "auto" else budget, speed, rate, device, measure, progress or _silent)
    chosen, reduced, (before, after), reach = _fitting(search, scene, sweep, horizon)
    report = BudgetReport(
        budget=budget,
        share=search.share,
        rate=rate,
        speed_asked=speed,
        speed=speed if search.fits(after) else round_down(after.speed(search.share, rate)),
        bodies=len(scene.bodies),
        kept=len(chosen.kept),
        frozen=tuple(scene.bodies[i].name for i in chosen.frozen),
        left=tuple(scene.bodies[i].name for i in chosen.left),
        before=before,
        after=after,
        accuracy=(scene.settings.accuracy, reduced.settings.accuracy),
        reach=_rule(reach),
        nearest=_nearest(reach, chosen),
        log=tuple(search.log),
    )
    return Reduced(scene=reduced, report=report)


def _fitting(
    search: _Search, scene: Scene, sweep: float, horizon: float | None
) -> tuple[Thinned, Scene, tuple[SceneCost, SceneCost], Reach | None]:
    """Steps 1 to 3, anew while the load of the machine changes: bodies, scene, cost before and after, and the reach."""
    everything = f"all {_bodies(len(scene.bodies))}"
    whole = Thinned(scene=scene, kept=tuple(range(len(scene.bodies))), frozen=(), left=())
    before = search.try_(scene, everything)
    for left in reversed(range(SEARCHES)):
        chosen, reduced, after, reach = whole, scene, before, None
        if search.fits(before):
            break
        reach = Reach.of(scene, sweep=sweep, horizon=horizon)
        chosen, after = _fewer_bodies(search, scene, reach, (chosen, after))
        reduced = chosen.scene
        if not search.fits(after):
            reduced, after = _coarser(search, reduced, after)
        # another program may have had the core when this began
        again = search.try_(scene, f"{everything} once more")
        if not search.changed(before, again):
            break
        if not left:
            search.log.append("the load of this machine keeps changing: the last search counts")
            break
        search.log.append("the load of this machine has changed: searched anew")
        before = again
    return chosen, reduced, (before, after), reach


def round_down(speed: float) -> float:
    """To two digits, never up: what is promised has to fit."""
    if speed <= 0.0:
        return speed
    digit = 10.0 ** (math.floor(math.log10(speed)) - 1)
    return float(f"{math.floor(speed / digit * (1.0 + 1e-12)) * digit:.2g}")


def _silent(line: str) -> None:
    del line


def _bodies(count: int) -> str:
    return f"{count} bod{'y' if count == 1 else 'ies'}"


def _rule(reach: Reach | None) -> dict[str, float | str] | None:
    """What the report says of the rule of reach."""
    if reach is None:
        return None
    return {"anchor": reach.anchor, "sweep": reach.sweep, "carried": reach.carried, "horizon": reach.horizon}


def _nearest(reach: Reach | None, chosen: Thinned) -> float | None:
    """How far beyond reach the nearest body is that does not move any more [µm]."""
    out = [*chosen.frozen, *chosen.left]
    return float(reach.gap[out].min()) if reach is not None and out else None


@dataclass
class _Search:
    """Measures candidates and keeps the account of it."""

    share: float
    speed: float
    rate: float
    device: str | None
    measure: Measure
    say: Progress
    log: list[str] = dataclasses.field(default_factory=list)

    def try_(self, scene: Scene, what: str) -> SceneCost:
        """Measure what a candidate costs, and note load and speed in the log."""
        self.say(f"measuring {what} (kernels that are new to this machine are compiled first)")
        cost = self.measure(scene, device=self.device, speed=self.speed, rate=self.rate)
        factor = cost.speed(1.0, self.rate)
        self.log.append(
            f"{what}: {100.0 * self.load(cost):.3g} % of a core, up to {factor:.3g}× real time ({cost.driver} driver, "
            f"time step {1e6 * cost.time_step:.4g} µs, ready in {cost.ready:.1f} s)"
        )
        return cost

    def load(self, cost: SceneCost) -> float:
        """Share of a core at the wanted speed."""
        return cost.load(self.speed, self.rate)

    def changed(self, before: SceneCost, again: SceneCost) -> bool:
        """Whether the same scene takes so much more or less than before that what was found is not to be kept."""
        ratio = self.load(again) / max(self.load(before), 1e-12)
        return not 1.0 / CHANGED <= ratio <= CHANGED

    def fits(self, cost: SceneCost) -> bool:
        """Whether a candidate keeps the wanted speed within the budget."""
        return self.load(cost) <= self.share


def _fewer_bodies(search: _Search, scene: Scene, reach: Reach, everything: _Candidate) -> _Candidate:
    """Step 2: the candidate with the most bodies that fits; the cheapest if none does."""
    stay = _staying(scene, reach)
    others = np.setdiff1d(np.arange(len(scene.bodies)), stay)
    # nearest first, so that the farthest go first; ties by index, so that the same scene is reduced the same way
    order = others[np.lexsort((others, reach.gap[others]))]
    if not len(stay):  # no scene is empty
        stay, order = order[:1], order[1:]
    if not len(order):
        search.log.append("no cell is beyond the reach of the traps: all bodies stay")
        return everything
    # a many-body scene that stays one shares its compiled step; a few bodies need another
    many = everything[1].driver == "grid"
    fewest = min(max(0, MAX_WORLD_BODIES + 1 - len(stay)) if many else 0, len(order) - 1)
    least = _trial(search, scene, reach, stay, order[:fewest])
    if search.fits(least[1]):
        return _bisect(search, scene, reach, (stay, order), (fewest, least), everything)
    tried = [everything, least]
    if fewest > 0:
        tried.append(_trial(search, scene, reach, stay, order[:0]))
    if not search.fits(tried[-1][1]) and tried[-1][0].frozen:
        tried.append(_trial(search, scene, reach, stay, order[:0], freeze=False))
    fitting = [c for c in tried[1:] if search.fits(c[1])]
    if fitting:
        return fitting[0]
    cheapest = min(tried[1:], key=lambda c: search.load(c[1]))
    if search.load(cheapest[1]) > WORTH * search.load(everything[1]):
        search.log.append("fewer bodies bring nothing: all bodies stay")
        return everything
    return cheapest


def _staying(scene: Scene, reach: Reach) -> np.ndarray:
    """Indices of bodies that always stay."""
    named = {s.prim: i for i, b in enumerate(scene.bodies) if b.instance is None for s in b.spheres}
    held = {named[t.holds] for t in scene.traps if t.holds is not None and t.holds in named}
    goal = scene.goal.cell if scene.goal else None
    return np.array(
        [
            i
            for i, body in enumerate(scene.bodies)
            if body.kind == "robot" or i in held or (scene.traps and reach.gap[i] <= 0.0) or body.name == goal
        ],
        dtype=int,
    )


def _trial(
    search: _Search, scene: Scene, reach: Reach, stay: np.ndarray, more: np.ndarray, *, freeze: bool = True
) -> _Candidate:
    thinned = thin_out(scene, np.concatenate([stay, more]).tolist(), reach, freeze=freeze)
    what = f"{_bodies(len(thinned.kept))}, {len(thinned.frozen)} frozen, {len(thinned.left)} left out"
    return thinned, search.try_(thinned.scene, what)


def _bisect(
    search: _Search,
    scene: Scene,
    reach: Reach,
    bodies: tuple[np.ndarray, np.ndarray],
    low: tuple[int, _Candidate],
    everything: _Candidate,
) -> _Candidate:
    """More and more of the far cells, between a number that fits and one that does not: by the secant, then halving."""
    stay, order = bodies
    count, best = low
    high, too_much = len(order), search.load(everything[1])
    for trial in range(TRIALS):
        load = search.load(best[1])
        if load >= CLOSE * search.share or high - count <= 1:
            break
        share = (0.5 * (1.0 + CLOSE) * search.share - load) / max(too_much - load, 1e-12)
        middle = count + round((high - count) * (share if trial < TRIALS - 1 else 0.5 * share))
        middle = min(max(middle, count + 1), high - 1)
        candidate = _trial(search, scene, reach, stay, order[:middle])
        if search.fits(candidate[1]):
            count, best = middle, candidate
        else:
            high, too_much = middle, search.load(candidate[1])
    return best


def _coarser(search: _Search, scene: Scene, cost: SceneCost) -> tuple[Scene, SceneCost]:
    """Step 3: the smallest error up to `WORST_ERROR` that fits; the largest that brings anything if none does."""
    wanted = scene.settings.accuracy
    if wanted >= WORST_ERROR:
        search.log.append(f"the accuracy stays: {100.0 * wanted:g} % is asked for, as much as the budget would allow")
        return scene, cost
    coarse = _at_accuracy(scene, WORST_ERROR)
    found = search.try_(coarse, f"the same at an error of {100.0 * WORST_ERROR:g} %")
    if found.time_step < LONGER * cost.time_step or found.error > WORST_ERROR:
        search.log.append(f"the accuracy stays: a lower one brings nothing, what limits the step is {found.chosen_by}")
        return scene, cost
    if not search.fits(found) and search.load(found) > WORTH * search.load(cost):
        search.log.append("the accuracy stays: a lower one brings too little")
        return scene, cost
    if search.fits(found) and cost.error > 0.0:
        # errors grow as a power of the step; what of the load goes with the number of steps has to shrink to the share
        power = math.log(WORST_ERROR / wanted) / math.log(found.time_step / cost.time_step)
        needed = cost.time_step * search.load(cost) / (0.5 * (1.0 + CLOSE) * search.share)
        error = wanted * (needed / cost.time_step) ** power
        if wanted < error < CLOSE * WORST_ERROR:
            error = float(f"{error:.2g}")
            finer = _at_accuracy(scene, error)
            between = search.try_(finer, f"the same at an error of {100.0 * error:g} %")
            if search.fits(between) and between.error <= WORST_ERROR:
                return finer, between
    return coarse, found


def _at_accuracy(scene: Scene, accuracy: float) -> Scene:
    """The scene with another wanted error; an authored time step gives way to the one that follows from it."""
    return dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, accuracy=accuracy, time_step=None))
