"""How the task of a scene stands, in a line."""

from __future__ import annotations

import numpy as np

from otwarp.record.monitor import Monitor
from otwarp.simulation.frame import Frame


def task_line(monitor: Monitor, frame: Frame) -> str:
    """Decided and why, or how far the cell is from where it is wanted; "" without a task."""
    goal = monitor.goal
    if goal is None:
        return ""
    ended = monitor.outcome(0)
    if ended.time is not None:
        return f"{ended.outcome} at t = {ended.time:.2f} s: {ended.reason}"
    away = np.linalg.norm(frame.position[0, monitor.cells[0]] - np.array(goal.position))
    return f"{goal.cell} is {away:.1f} µm from the goal (tolerance {goal.tolerance:g} µm)"
