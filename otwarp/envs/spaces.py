"""Spaces of a task, as Gymnasium has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.envs.kernels.judge import LIMIT
from otwarp.envs.layout import Layout


def action_space(layout: Layout) -> Any:
    """Of one environment: numbers within ±1, or one of the choices."""
    from gymnasium import spaces

    if layout.task.choices:
        return spaces.Discrete(len(layout.task.choices))
    return spaces.Box(-1.0, 1.0, (len(layout.acted),), np.float32)


def observation_space(layout: Layout) -> Any:
    """Of one environment: scaled numbers, cut off at ± `LIMIT`; grey levels (height, width, 1); or both by name."""
    from gymnasium import spaces

    limit, task = float(LIMIT), layout.task
    state = spaces.Box(-limit, limit, (len(layout.seen),), np.float32)
    if task.observation == "state":
        return state
    image = spaces.Box(0, 255, (*task.image_size[::-1], 1), np.uint8)
    return image if task.observation == "image" else spaces.Dict({"image": image, "state": state})
