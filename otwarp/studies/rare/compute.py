"""What is computed at a point: interfaces by a pilot, runs, and the same runs with half the time step."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene, Track
from otwarp.simulation.model import Model
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.design import at_values
from otwarp.studies.plan import steps_in
from otwarp.studies.rare.ensemble import Ensemble
from otwarp.studies.rare.forward_flux import Estimates, forward_flux
from otwarp.studies.rare.layout import PILOT, Layout
from otwarp.studies.rare.orders import Order
from otwarp.studies.rare.placement import MOST, Placement, place
from otwarp.studies.rare.splitting import splitting
from otwarp.studies.rows import origin_of, parameter_rows

Found = dict[str, np.ndarray]
"""Arrays of a point, by their names in the store."""


class AnyEscapeStudy(AnyStudy, Protocol):
    """What is needed of an `EscapeStudy`, whose arguments these are."""

    order: Order
    interfaces: np.ndarray | None
    basin: float | None
    method: str
    runs: int
    branches: int
    crossing: float
    relax: float | None
    every: int
    halved: bool


def own_step_counts(study: AnyEscapeStudy) -> np.ndarray:
    """(points) steps over the horizon, of the step that each point needs by itself.

    A `Model` counts with the power that a trap has in its scene, to which it may be commanded; here it has that of the
    point, and weak traps take long steps.
    """
    counts = np.empty(study.design.points, dtype=int)
    for points, values in study.design.groups(np.arange(study.design.points)):
        scene = study.design.scene_of(values)
        origin = origin_of(scene, study.options)
        for point in points:
            at = {t: v for t, v in study.design.at(np.array([point])).items() if t.kind == "parameter"}
            rows = parameter_rows(origin, at, 1)
            own = _with_powers(scene, rows["trap_power"][0]) if "trap_power" in rows else scene
            try:
                model = Model.build(own, device="cpu", parameters=rows, options=study.options)
            except InputError as error:
                raise at_values(error, values | {t: v[0] for t, v in at.items()}) from None
            counts[point] = steps_in(study, model.time_step)
    return counts


def _with_powers(scene: Scene, powers: np.ndarray) -> Scene:
    """The scene with traps of other powers, those that follow no time samples."""
    traps = tuple(
        trap if trap.power.animated else dataclasses.replace(trap, power=Track.constant(float(power)))
        for trap, power in zip(scene.traps, powers, strict=True)
    )
    return dataclasses.replace(scene, traps=traps)


def rates_at(study: AnyEscapeStudy, point: int, *, worlds: int, **how: Any) -> Found:
    """All that the store keeps of a point.

    Args:
        study: Whose point it is.
        point: Its number.
        worlds: Paths that run at once, at most, but for those of one run.
        how: `device`, `threads` and `unwanted`, as of `Ensemble`.

    Raises:
        CancelledError: `unwanted` was set meanwhile.
        InputError: What only the paths show, such as an order parameter that is NaN; the message names the point.
    """
    try:
        return _rates_at(study, point, worlds, how)
    except InputError as error:
        at = study.design.at(np.array([point]))
        where = ", ".join(f"{t.name} = {np.round(v[0], 6)} {t.unit}".rstrip() for t, v in at.items())
        raise InputError(f"at {where}: {error}" if where else str(error)) from None


def _rates_at(study: AnyEscapeStudy, point: int, worlds: int, how: dict[str, Any]) -> Found:
    (group,) = study.design.groups(np.array([point]))
    scene, m, first = study.design.scene_of(group[1]), study.branches, point * (study.runs + 1)
    at = {t: v for t, v in study.design.at(np.array([point])).items() if not t.grouped}
    step, stride = study.horizon / int(study.step_counts[point]), max(m, PILOT)
    rows = parameter_rows(origin_of(scene, study.options), at, 1)
    scene = _with_powers(scene, rows["trap_power"][0]) if "trap_power" in rows else scene

    def ensemble(worlds: int, halves: int) -> Ensemble:
        """So many worlds of this point."""
        return Ensemble(
            scene,
            at,
            worlds,
            order=study.order,
            seed=study.seed,
            time_step=step / halves,
            every=study.every * halves,
            options=study.options,
            **how,
        )

    pilot = ensemble(stride, 1)
    look = study.every * step
    window = max(4, int(0.5 * study.horizon / look)) if pilot.moving else None
    (found,) = place(
        pilot,
        Layout(study.seed, np.array([first + study.runs]), stride, stride),
        crossing=study.crossing,
        interfaces=study.interfaces,
        basin=study.basin,
        relax=None if study.relax is None else int(np.ceil(study.relax / look)),
        window=window,
        automatic=study.method == "forward-flux",
    )
    arrays: Found = {
        "trials": np.array(study.runs, dtype=np.int32),
        "basin": np.array(found.basin),
        "relax": np.array(found.relax * look),
        "interface_at": _padded(found.interfaces),
    }
    together = max(1, min(study.runs, worlds // m))
    for halves, name in ((1, ""), (2, "_halved")) if study.halved else ((1, ""),):
        side_by_side = ensemble(together * m, halves)
        parts = []
        for begun in range(0, study.runs, together):
            count = min(together, study.runs - begun)
            if count < together:
                side_by_side = ensemble(count * m, halves)
            layout = Layout(study.seed, first + np.arange(begun, begun + count), m, stride, halves == 2)
            parts.append(_runs(study, side_by_side, layout, found, window))
        arrays |= _named(parts, name)
        if not name:
            fault, rate = (np.concatenate([getattr(p, n) for p in parts]) for n in ("fault", "rate"))
            arrays["end"] = np.where(fault, -1, np.where(rate > 0.0, 1, 0)).astype(np.int8)
    return arrays


def _runs(study: AnyEscapeStudy, ensemble: Ensemble, layout: Layout, place: Placement, window: int | None) -> Estimates:
    """Estimates of some runs.

    Raises:
        InputError: Paths go on after what moves has come to its end.
    """
    places = [place] * len(layout.runs)
    if study.method == "forward-flux":
        out = forward_flux(ensemble, layout, places, window=window)
    else:
        out = splitting(ensemble, layout, places, crossing=study.crossing, window=window)
    if ensemble.moving and out.latest * ensemble.sim.time_step > study.horizon:
        raise InputError(f"a path that began within {0.5 * study.horizon:g} s goes on after {study.horizon:g} s; "
                         "allowed: traps and obstacles that move for longer, and a longer horizon")  # fmt: skip
    return out


def _named(parts: list[Estimates], name: str) -> Found:
    """Arrays of all runs, by their names in the store."""
    found = {n: np.concatenate([getattr(p, n) for p in parts]) for n in ("flux", "probability", "rate", "steps")}
    fault = np.concatenate([p.fault for p in parts])
    found["rate"] = np.where(fault, np.nan, found["rate"])
    return {f"{n}{name}_of_trial": values for n, values in found.items()}


def _padded(values: np.ndarray) -> np.ndarray:
    out = np.full(MOST, np.nan)
    out[: len(values)] = values
    return out
