"""What `otwarp bench integrators` compares: integrators, then force models and precisions with the default one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from otwarp.bench.rungs import LADDER, Rung
from otwarp.bench.typed import check_names
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Settings

GROUPS = ("integrator", "force", "precision")

DEFAULT = Settings().integrator
"""Integrator of a scene that names none."""

TABLE = "bilinear-1e-3"
"""Rung of a trap that says no more than `table`."""

MODELS = ("harmonic", "piecewise", TABLE, "bicubic-1e-3", "bicubic-1e-4")

PLAIN = "eulerMaruyama-plain"
"""Euler–Maruyama as it is commonly written: who is out at the end of a step has escaped, and nobody else."""

PLAIN_LABEL = "Euler–Maruyama, escapes seen at steps only"


@dataclass(frozen=True, kw_only=True)
class Case:
    """One way to simulate the bead.

    Attributes:
        name, label: For programs and for people.
        group: One of `GROUPS`.
        rung: Force model.
        settings: Further arguments of `Simulation`.
        order: Leading power of its errors in the time step.
    """

    name: str
    label: str
    group: str
    rung: Rung
    settings: dict[str, Any] = field(default_factory=dict)
    order: float = 1.0

    @property
    def sees_crossings(self) -> bool:
        """Whether escapes between steps count."""
        return self.settings.get("crossings", True)


def rung(name: str) -> Rung:
    """A rung of the ladder of force models."""
    return {r.name: r for r in LADDER}[name]


def all_cases(groups: Sequence[str], *, fast_math: bool) -> tuple[Case, ...]:
    """The cases of these groups, of all for none; the default integrator is always among them.

    Raises:
        InputError: A group that is not in `GROUPS`.
    """
    check_names("--axis", groups, GROUPS)
    wanted = groups or GROUPS
    common = {"fast_math": fast_math}
    cases = [c for c in _integrators(common) if "integrator" in wanted or c.name == DEFAULT]
    if "force" in wanted:
        cases += [Case(name=n, label=rung(n).label, group="force", rung=rung(n), settings=common) for n in MODELS]
    return tuple(cases + (_precisions() if "precision" in wanted else []))


def _integrators(common: dict[str, Any]) -> list[Case]:
    cases = []
    for name, scheme in INTEGRATORS.items():
        how = {**common, "integrator": name}
        about: dict[str, Any] = {"group": "integrator", "rung": rung(TABLE), "order": float(scheme.weak_order)}
        cases.append(Case(name=name, label=scheme.title, settings=how, **about))
        if name == "eulerMaruyama":
            cases.append(Case(name=PLAIN, label=PLAIN_LABEL, settings={**how, "crossings": False}, **about))
    return cases


def _precisions() -> list[Case]:
    kinds: dict[str, dict[str, Any]] = {
        "float32": {"fast_math": False},
        "float32, fast_math": {"fast_math": True},
        "float64": {"precision": "float64"},
    }
    return [Case(name=k, label=k, group="precision", rung=rung(TABLE), settings=how) for k, how in kinds.items()]
