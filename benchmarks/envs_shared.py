"""Shared control of the cell delivery: a scripted policy beside the full SIMULATED operators of `otwarp.operators`.

Operators have their eyes' and muscles' delays and noise, arms, and the servo's haptic chains at 1 kHz; beside them the
script of `CellDelivery` moves both hands by what it sees 20 times a second. In every servo period the traps go on by
(1 − a) of what the chain makes of the hand, and by a of what the policy wants; the chain is told where they have come
to, so that hands feel the traps where they are, and operators see the difference and take it back as any other.

`python -m benchmarks.envs_shared [--write]` puts the table on docs/benchmarks/envs_learning.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from scipy.stats import binomtest

from benchmarks.report import commit, positive, run, save_page
from benchmarks.validation import put_on_page
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.envs.experts.delivery import SPEED_LIMIT, Carrier
from otwarp.envs.task import Policy
from otwarp.operators.kernels.chain_data import MotionState
from otwarp.operators.kernels.types import TaskData
from otwarp.operators.loop import Loop
from otwarp.operators.study import OperatorStudy
from otwarp.operators.task import OUTCOMES, REACHED, Task
from otwarp.scene import Scene

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "envs_learning.md"
BEGIN, END = "<!-- begin envs_learning operators -->", "<!-- end envs_learning operators -->"
AUTHORITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
RATE = 20.0
"""Decisions of the policy a second [Hz]."""
LOOK = 5
"""Decisions between looks whether anybody is still at work."""


@wp.kernel(enable_backward=False)
def share(
    task: TaskData, authority: wp.float64, lent: wp.array2d(dtype=wp.vec3d), done: wp.array(dtype=wp.int32),
    before: wp.array2d(dtype=wp.vec3d), motion: wp.array(dtype=MotionState), commanded: wp.array2d(dtype=wp.vec3d),
):  # fmt: skip
    """Over (worlds, hands): of the way of a period [µm], `authority` is the policy's, whose velocity is `lent`."""
    world, hand = wp.tid()
    if done[world] != 0:
        return
    n = world * before.shape[1] + hand
    state = motion[n]
    shift = authority * (task.period * lent[world, hand] - (state.commanded - before[world, hand]))
    state.commanded = state.commanded + shift
    state.carried = state.carried + shift
    motion[n] = state
    before[world, hand] = state.commanded
    for t in range(task.hand_of.shape[0]):
        if task.hand_of[t] == hand:
            commanded[world, t] = commanded[world, t] + shift


class SharedLoop(Loop):
    """Simulated operators who share control with a policy.

    Args:
        task: What they are asked to do.
        persons: (W) structs of `otwarp.operators.people.persons`.
        policy: Of `CellDelivery`: sees the cell's place and the time that is left.
        authority: Share of the policy, 0 to 1.
        how: As `Loop`.
    """

    def __init__(self, task: Task, persons: np.ndarray, policy: Policy, authority: float, **how: Any):
        assert not any(plan.config.absolute for plan in task.plans), "a chain of steps, which can be shifted"
        self.policy, self.authority = policy, authority
        super().__init__(task, persons, **how)

    def prepare(self, local: Any) -> None:
        """Before the graph is captured: what the policy lends, and where the chain had the hands."""
        super().prepare(local)
        worlds, device = self.sim.model.worlds, self.sim.model.device
        shape = (worlds, len(self.task.plans))
        self.lent = wp.zeros(shape, dtype=wp.vec3d, device=device)
        self.before = wp.zeros(shape, dtype=wp.vec3d, device=device)
        wp.load_module(share.module, device=device)

    def command_traps(self) -> None:
        """Share the way of the period, and put the traps there."""
        shape, chain = self.lent.shape, self.chain
        self.launch(
            share, shape, self.people.task, wp.float64(self.authority), self.lent, self.sim.episodes.done, self.before,
            chain.motion, chain.commanded,
        )  # fmt: skip
        super().command_traps()

    def decide(self, *, first: bool) -> None:
        """Let the policy look, and lend its velocities."""
        sim, worlds = self.sim, self.sim.model.worlds
        place = sim.state.position.numpy()[:, self.task.cell]
        seen = {f"body_position.{axis}": place[:, i].astype(float) for i, axis in enumerate("xy")}
        seen["time_left"] = self.task.duration - sim.episodes.time
        action = self.policy(seen, np.full(worlds, first))
        velocity = np.zeros((worlds, len(self.task.plans), 3))
        velocity[:, :, :2] = SPEED_LIMIT * action.reshape(worlds, -1, 2)
        self.lent.assign(velocity)

    def finish(self) -> None:
        """Go on until nobody is at work any more."""
        decisions = 0
        while decisions % LOOK or self.running:
            self.decide(first=decisions == 0)
            self.run(1.0 / RATE)
            decisions += 1


def study(operators: int, condition: str) -> OperatorStudy:
    """Who takes part."""
    scene = Scene.load(ROOT / "scenes" / "cell_delivery.usda")
    return OperatorStudy(scene=scene, operators=operators, seed=1, conditions=(condition,), chunk=operators)


def trials(asked: OperatorStudy, authority: float, device: str) -> np.ndarray:
    """(n) outcomes of all operators."""
    task, people = asked.task, asked.persons(np.arange(asked.count))
    speed = float(np.linalg.norm(np.diff(task.path[0], axis=0), axis=1).sum() / task.end)
    how = {"seed": asked.seed, "device": device, "time_step": asked.time_step, "frame_rate": asked.frame_rate}
    loop = SharedLoop(task, people, Carrier(speed=speed), authority, **how)
    loop.finish()
    return loop.sim.episodes.done.numpy()


def row(condition: str, authority: float, outcome: np.ndarray) -> str:
    """A line of the table for (n) outcomes."""
    good, count = int(np.count_nonzero(outcome == REACHED)), len(outcome)
    rate, interval = good / count, binomtest(good, count).proportion_ci(0.95, method="exact")
    error = np.sqrt(rate * (1.0 - rate) / count)
    failed = [code for code in np.unique(outcome) if code != REACHED]
    others = ", ".join(f"{OUTCOMES[code]} {np.count_nonzero(outcome == code)}" for code in failed)
    delivered = f"{rate:.3f} [{interval.low:.3f}, {interval.high:.3f}]"
    return f"| {authority:.2f} | {condition} | {delivered} | {error:.3f} | {others or '–'} |"


def table(operators: int, device: str) -> str:
    """Deliveries by authority, with and without haptics."""
    lines = [
        f"| share of the policy | haptics | delivered of {operators}, 95 % interval | standard error | "
        "how the others ended |",
        "|---:|---|---:|---:|---|",
    ]
    for condition in ("without", "with"):
        for authority in AUTHORITIES:
            print(f"{condition}, {authority:g}", flush=True)
            lines.append(row(condition, authority, trials(study(operators, condition), authority, device)))
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Shared control with full SIMULATED operators at the cell delivery.")
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--operators", type=positive, default=64, help="each at every share (default: 64)")
    parser.add_argument("--write", action="store_true", help=f"write docs/benchmarks/{PAGE.name}")
    given = parser.parse_args()
    machine = Machine.look(pick_device(given.device))
    text = f"{table(given.operators, given.device)}\n\nCommit {commit()}, {machine.name()}."
    print(text)
    if given.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))


if __name__ == "__main__":
    run(main)
