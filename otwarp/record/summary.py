"""`summary.json`: what was run, how it ended, and how close to trouble it came."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from otwarp import __version__
from otwarp.files import written
from otwarp.record.monitor import DELIVERED, OUTCOMES, Monitor
from otwarp.record.netcdf import scene_name
from otwarp.scene import Scene

LISTED_WORLDS = 16
"""Up to so many worlds are listed one by one; beyond, they are counted."""


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write strict JSON beside its destination and put it there as a whole; what is not finite becomes null."""
    text = json.dumps(strict(data), indent=2, ensure_ascii=False, allow_nan=False)
    with written(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def strict(value: Any) -> Any:
    """`value` as strict JSON can hold it: numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [strict(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def task(monitor: Monitor, worlds: int) -> dict[str, Any] | None:
    """How the task ended: per world, or counted; None for a scene without a goal."""
    if monitor.goal is None:
        return None
    out: dict[str, Any] = {"goal": monitor.goal.prim, "counts": monitor.counts()}
    if worlds <= LISTED_WORLDS:
        ends = [monitor.outcome(world) for world in range(worlds)]
        out["worlds"] = [{"world": e.world, "outcome": e.outcome, "time_s": e.time, "reason": e.reason} for e in ends]
    else:
        out["median_time_s"] = {
            name: float(np.median(monitor.times(name))) for name in OUTCOMES[DELIVERED:] if len(monitor.times(name))
        }
    return out


def statistics(monitor: Monitor) -> dict[str, Any]:
    """Robot–trap distance, contact force of the robots and load on the cells, with their warning lines."""
    bodies = monitor.scene.bodies
    out: dict[str, Any] = {}
    if any(len(traps) for traps in monitor.traps_of):
        line = monitor.warning_distance
        out["trap_distance"] = {"unit": "µm", "warning_line": line, **monitor.distance.pooled()}
        out["trap_distance"]["robots"] = {
            bodies[r].name: monitor.distance.pooled((slice(None), n)) for n, r in enumerate(monitor.robots)
        }
    if monitor.robots and monitor.touching:
        line = float(monitor.warning_force.min())
        out["contact_force"] = {"unit": "pN", "warning_line": line, **monitor.force.pooled()}
        out["contact_force"]["robots"] = {
            bodies[r].name: monitor.force.pooled((slice(None), n)) for n, r in enumerate(monitor.robots)
        }
    if monitor.cells and monitor.touching:
        line = float(monitor.warning_load.min())
        out["cell_load"] = {"unit": "pN", "warning_line": line, "cells": len(monitor.cells), **monitor.load.pooled()}
    return out


def warnings(monitor: Monitor, numbers: dict[str, Any]) -> list[str]:
    """Sentences about what the user should look at."""
    names = {
        "trap_distance": "the robot–trap distance",
        "contact_force": "the contact force of a robot",
        "cell_load": "the load on a cell",
    }
    out = []
    for key, name in names.items():
        part = numbers.get(key)
        if part and part["fraction_above"]:
            share, line, unit = 100.0 * part["fraction_above"], part["warning_line"], part["unit"]
            out.append(f"{name} was above its warning line of {line:g} {unit} for {share:.2g} % of the time")
    number, first = escapes(monitor)
    if first is not None:
        what, which = "a trap lost the sphere that it holds", ""
        if number > 1:
            what, which = f"{number} traps lost the spheres that they hold", "first "
        where = f" in world {first['world']}" if len(monitor.escape_time) > 1 else ""
        out.append(f"{what}: {which}{first['trap']} at t = {first['time_s']:.4g} s{where}")
    return out


def escapes(monitor: Monitor) -> tuple[int, dict[str, Any] | None]:
    """How many traps, over all worlds, lost their spheres before the outcome, and the first of them.

    A trap counts once: at the first step at which its sphere was out of its reach.
    """
    when = monitor.escape_time
    if not np.isfinite(when).any():
        return 0, None
    world, trap = np.unravel_index(np.nanargmin(when), when.shape)
    first = {"trap": monitor.scene.traps[int(trap)].prim, "world": int(world), "time_s": float(when[world, trap])}
    return int(np.isfinite(when).sum()), first


def summarize(scene: Scene, monitor: Monitor, facts: dict[str, Any]) -> dict[str, Any]:
    """The whole summary.

    Args:
        scene: What was run.
        monitor: What it saw.
        facts: `status`, `worlds`, `recorded_worlds`, `seed`, `time_step_s`, `time_step_errors`, `method`, `steps`,
            `frames`, `duration_s`, `asked_s`, `wall_time_s` and `warnings` so far.

    Returns:
        What goes to `summary.json`; `text` is the same for people, in a few lines.
    """
    numbers = statistics(monitor)
    number, first = escapes(monitor)
    wall = facts["wall_time_s"]
    out = {
        "status": facts["status"],
        "scene": scene_name(scene),
        "otwarp_version": __version__,
        **{k: facts[k] for k in ("worlds", "recorded_worlds", "seed", "time_step_s", "time_step_errors", "method")},
        **{k: facts[k] for k in ("steps", "frames", "duration_s", "asked_s")},
        "wall_time_s": wall,
        "real_time_factor": facts["duration_s"] / wall if wall > 0.0 else None,
        "task": task(monitor, facts["worlds"]),
        **numbers,
        "escapes": number,
        "first_escape": first,
        **({} if monitor.entries is None else {"entries": monitor.entries}),
        "warnings": [*facts["warnings"], *warnings(monitor, numbers)],
    }
    return strict({**out, "text": _text(out)})


def _text(s: dict[str, Any]) -> str:
    worlds = f", {s['worlds']} worlds" if s["worlds"] > 1 else ""
    factor = f" ({s['real_time_factor']:.3g}× real time, recording included)" if s["real_time_factor"] else ""
    run = f"{s['scene']}: {s['duration_s']:.4g} s simulated in {s['wall_time_s']:.3g} s{factor}{worlds}"
    lines = [run if s["status"] == "finished" else f"{run}; {s['status']}"]
    if s["time_step_errors"]:
        # beside the kernels, which take seconds to import
        from otwarp.simulation.time_step.observables import spelled

        lines.append(f"time step {s['time_step_s']:.4g} s, estimated errors: {spelled(s['time_step_errors'], 1e-4)}")
    if s["task"] is not None:
        ends = s["task"].get("worlds")
        if ends is not None and len(ends) == 1:
            when = "" if ends[0]["time_s"] is None else f" at t = {ends[0]['time_s']:.4g} s"
            lines.append(f"{ends[0]['outcome']}{when}: {ends[0]['reason']}")
        else:
            lines.append(", ".join(f"{n} {name}" for name, n in s["task"]["counts"].items() if n))
    for key, name in (
        ("trap_distance", "robot–trap distance"),
        ("contact_force", "contact force"),
        ("cell_load", "load on the cell"),
    ):
        if s.get(key, {}).get("maximum"):
            lines.append(f"{name} {s[key]['mean']:.3g} ± {s[key]['std']:.2g} {s[key]['unit']}")
    if "entries" in s:
        lines.append(f"{s['entries']} times a cell left the domain and came in again")
    return "\n".join([*lines, *(f"warning: {w}" for w in s["warnings"])])
