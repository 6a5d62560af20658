"""What the budget did to a scene, as lines to print and as JSON."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from typing import Any

from otwarp.scene.description import Scene
from otwarp.teleop.budget.cost import FRAME_RATE, Cost


@dataclass(frozen=True, kw_only=True)
class BudgetReport:
    """What was kept, frozen and dropped, what it cost before and after, and how fast it will run.

    Attributes:
        budget: As asked for: `auto`, `off`, or a share.
        share: Of a core that the simulation may take.
        rate: Frames per second of wall time.
        speed_asked: Simulated seconds per second that were wanted.
        speed: That the session is to run at: what was wanted, or less if nothing else made it fit.
        bodies: Of the scene as loaded.
        kept: How many of them move.
        frozen: Names of those that became obstacles.
        left: Names of those that are not there any more.
        before, after: Cost of the scene as loaded, and as it will run; None where nothing was measured.
        accuracy: Wanted error before and after [1].
        reach: What counted as within reach: `anchor`, and `sweep` [µm], `carried` [µm], `horizon` [s].
        nearest: How far beyond reach the nearest body is that moves no more [µm].
        log: What was measured, in order.
    """

    budget: str | float
    share: float
    rate: float
    speed_asked: float
    speed: float
    bodies: int
    kept: int
    frozen: tuple[str, ...]
    left: tuple[str, ...]
    before: Cost | None
    after: Cost | None
    accuracy: tuple[float, float]
    reach: dict[str, float | str] | None
    nearest: float | None
    log: tuple[str, ...]

    @classmethod
    def off(cls, scene: Scene, speed: float) -> BudgetReport:
        """Nothing measured, nothing changed."""
        count = len(scene.bodies)
        return cls(
            budget="off",
            share=1.0,
            rate=FRAME_RATE,
            speed_asked=speed,
            speed=speed,
            bodies=count,
            kept=count,
            frozen=(),
            left=(),
            before=None,
            after=None,
            accuracy=(scene.settings.accuracy, scene.settings.accuracy),
            reach=None,
            nearest=None,
            log=(),
        )

    @property
    def fits(self) -> bool:
        """Whether the wanted speed is kept."""
        return self.speed >= self.speed_asked

    @property
    def reduced(self) -> bool:
        """Whether the scene is not as it was loaded."""
        return bool(self.frozen or self.left) or self.accuracy[0] != self.accuracy[1]

    def lines(self, *, log: bool = False) -> list[str]:
        """What a user should read; with `log` also what was measured on the way."""
        if self.before is None or self.after is None:
            return ["budget off: nothing was measured, nothing was left out"]
        found = [f"budget {self.budget}: {100.0 * self.share:g} % of one core for the simulation"]
        found += [f"  measured {line}" for line in self.log] if log else []
        found.append(f"as loaded: {self._cost_line(self.before, self.speed_asked)}")
        if not self.reduced and self.fits:
            return [*found, f"all {self.bodies} bodies stay, nothing was left out"]
        found += self._body_lines()
        if self.accuracy[0] != self.accuracy[1]:
            found.append(
                f"accuracy lowered from {100.0 * self.accuracy[0]:g} % to {100.0 * self.accuracy[1]:g} %: time step "
                f"{1e6 * self.before.time_step:.4g} → {1e6 * self.after.time_step:.4g} µs (stable below "
                f"{_micro(self.after.largest_stable)}), predicted error {100.0 * self.after.error:.2g} %"
            )
        if self.reduced:
            found.append(f"as it will run: {self._cost_line(self.after, self.speed)}")
        if not self.fits:
            found.append(
                f"real time does not fit: slow motion at {self.speed:g} of {self.speed_asked:g} simulated seconds per "
                "second; simulated time does not slip"
            )
        return found

    def _cost_line(self, cost: Cost, speed: float) -> str:
        return (
            f"{cost.bodies} moving, {100.0 * cost.load(speed, self.rate):.3g} % of a core at {speed:g}× speed; a whole "
            f"core would reach {cost.speed(1.0, self.rate):.3g}× real time"
        )

    def _body_lines(self) -> list[str]:
        """Bodies, and why."""
        out = len(self.frozen) + len(self.left)
        if not out or self.reach is None:
            return [f"all {self.bodies} bodies stay"]
        anchor = self.reach["anchor"]
        if anchor == "traps":
            near = "–" if self.nearest is None else f"{self.nearest:.3g} µm"
            sweep, carried, horizon = (self.reach[name] for name in ("sweep", "carried", "horizon"))
            rule = (
                f"beyond what the traps reach: {sweep:g} µm from their paths, and {carried:.3g} µm of what they carry, "
                f"in {horizon:g} s; the nearest by {near}"
            )
        else:
            rule = f"farthest from {anchor}, for the scene has no traps"
        names = " ".join(part for part in (_short("frozen", self.frozen), _short("left out", self.left)) if part)
        found = [f"{self.kept} of {self.bodies} bodies stay; {names}", f"  ({rule})"]
        if self.frozen:
            found.append("  (a frozen cell is a wall to what touches it: rigid, immovable, without adhesion)")
        return found

    def to_json(self) -> dict[str, Any]:
        """For a program; bodies of a PointInstancer as the list of their indices."""
        data = dataclasses.asdict(self)
        for name in ("frozen", "left"):
            data[name] = _grouped(getattr(self, name))
        for name in ("before", "after"):
            cost = getattr(self, name)
            if cost is not None:
                speed = self.speed_asked if name == "before" else self.speed
                stable = cost.largest_stable if math.isfinite(cost.largest_stable) else None
                data[name] |= {
                    "largest_stable": stable,
                    "load": cost.load(speed, self.rate),
                    "real_time_factor": cost.speed(1.0, self.rate),
                }
        return data | {"fits": self.fits, "reduced": self.reduced, "lines": self.lines()}


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.4g} µs" if math.isfinite(seconds) else "any length"


def _grouped(names: tuple[str, ...]) -> dict[str, list[int] | None]:
    """Bodies by prim: the indices of its instances, None for a body of its own."""
    found: dict[str, list[int] | None] = {}
    for name in names:
        match = re.fullmatch(r"(.*)\[(\d+)\]", name)
        if match is None:
            found[name] = None
        else:
            indices = found.setdefault(match[1], [])
            if indices is not None:
                indices.append(int(match[2]))
    return found


def _short(what: str, names: tuple[str, ...]) -> str:
    """How many, and of which prims."""
    if not names:
        return ""
    groups = [name if rows is None else f"{name}[{len(rows)}]" for name, rows in _grouped(names).items()]
    more = f" and {len(groups) - 3} more" if len(groups) > 3 else ""
    return f"{what}: {len(names)} ({', '.join(groups[:3])}{more})"
