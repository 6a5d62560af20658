"""From light to force, stage by stage: what took how long, as percentiles."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

STAGES = {
    "exposure": "half of it: light counts at its middle",
    "rendering": "where the laboratory is simulated: until somebody asks, and rendering itself; a real camera has none",
    "readout": "of a real camera, until it hands the frame on",
    "transport": "from the camera to who reads it",
    "crop": "pieces around the bodies",
    "estimate": "the network or the templates, all bodies together",
    "wait": "until the loop's next turn",
    "twin": "its steps in that turn",
    "filter": "trackers: measurement in, prediction to now, the twin aligned",
    "publish": "readout, and the state to the servo",
}
"""Stage → what it is, in their order; what the servo and the device add is said by the session."""

KEPT = 20_000
"""Last frames that count."""


class Latency:
    """Durations of all stages [s]."""

    def __init__(self) -> None:
        self._rows: dict[str, deque[float]] = {name: deque(maxlen=KEPT) for name in (*STAGES, "total", "without")}

    def add(self, stages: dict[str, float]) -> None:
        """The stages of one frame, by the names of `STAGES` [s]."""
        total = sum(stages.values())
        for name, value in (stages | {"total": total, "without": total - stages.get("rendering", 0.0)}).items():
            self._rows[name].append(max(value, 0.0))

    def __len__(self) -> int:
        return len(self._rows["total"])

    def percentiles(self) -> dict[str, dict[str, float]]:
        """Stage, `total` and `without` rendering → its `p50` and `p99` [s]."""
        found: dict[str, dict[str, float]] = {}
        for name, row in self._rows.items():
            if row:
                half, most = np.percentile(np.array(row), [50.0, 99.0])
                found[name] = {"p50": float(half), "p99": float(most)}
        return found


def table(percentiles: dict[str, dict[str, Any]]) -> list[str]:
    """Lines of it, in milliseconds."""
    lines = []
    for name in (*STAGES, "without", "total"):
        if name in percentiles:
            row, label = percentiles[name], "all but rendering" if name == "without" else name
            lines.append(f"  {label:<18}{1e3 * row['p50']:8.2f} ms {1e3 * row['p99']:8.2f} ms")
    return lines
