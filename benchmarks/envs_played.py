"""Tables of episodes of policies: played once, kept in out/envs_learning with commit and machine, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from benchmarks.report import commit
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.envs.rollout import Rollout, run_policy
from otwarp.envs.task import Policy, Task
from otwarp.files import written

OUT = Path(__file__).parents[1] / "out" / "envs_learning"
SEED = 3_000_000_000
"""Of the first episode of scripts: no policy has trained with it."""


class Table:
    """Lines of a table of episodes, and where these were played.

    Args:
        head: Its first line.
        align: Its second.
        device: Where what has not been played is played now.
    """

    def __init__(self, head: str, align: str, device: str):
        self.lines, self.device = [head, align], device
        self.where: list[str] = []

    def played(self, task: Task, said: str, make: Callable[[], Policy], episodes: int) -> Rollout:
        """Episodes of a policy, played now if they have not been."""
        found, where = played(task, said, make, episodes, self.device)
        self.where += [where] if where not in self.where else []
        return found

    def __str__(self) -> str:
        return "\n".join([*self.lines, "", "  \n".join(self.where)])


def played(task: Task, said: str, make: Callable[[], Policy], episodes: int, device: str) -> tuple[Rollout, str]:
    """Episodes of a script, run now if they have not been; and commit and machine of that."""
    file = OUT / f"{''.join(c if c.isalnum() else '_' for c in said)}_{episodes}.npz"
    if not file.is_file():
        print(f"{said}: {episodes} episodes", flush=True)
        file.parent.mkdir(parents=True, exist_ok=True)
        found = run_policy(task, make(), episodes=episodes, seed=SEED, device=device)
        with written(file, f"out/{file.name}") as part, part.open("wb") as stream:
            where = f"Commit {commit()}, {Machine.look(pick_device(device)).name()}."
            np.savez(stream, where=where, **vars(found))
    with np.load(file) as kept:
        rows = dict(kept)
    where = str(rows.pop("where"))
    return Rollout(**rows), where


def rate_of(found: Rollout) -> str:
    """Share of successes, with its interval."""
    interval = binomtest(int(found.success.sum()), len(found.success)).proportion_ci(0.95, method="exact")
    return f"{found.rate:.3f} [{interval.low:.3f}, {interval.high:.3f}]"


def time_of(task: Task, found: Rollout) -> str:
    """Mean time to success [s]."""
    return f"{found.periods[found.success].mean() / task.rate:.1f}" if found.success.any() else "–"


def others_of(task: Task, found: Rollout) -> str:
    """Ends that were not wanted, the most frequent first."""
    names = {-1: "fault", 0: "out of time"} | {n: end.name for n, end in enumerate(task.ends, start=1)}
    counts = Counter(names[int(code)] for code in found.outcome[~found.success])
    return ", ".join(f"{name} {count}" for name, count in counts.most_common()) or "–"
