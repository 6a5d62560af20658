"""Shared control of the cell delivery: a policy beside the full SIMULATED operators of `otwarp.operators`.

Operators have their eyes' and muscles' delays and noise, arms, and the servo's haptic chains at 1 kHz; beside them the
script of `CellDelivery`, or what was trained at it, moves both hands by what it sees 20 times a second. In every servo
period the traps go on by (1 − a) of what the chain makes of the hand, and by a of what the policy wants; the chain is
told where they have come to, so that hands feel the traps where they are, and operators see the difference and take it
back as any other.

`python -m benchmarks.envs_shared [--write]` puts the tables on docs/benchmarks/envs_learning.md; that of the trained
policy is of the training that `python -m benchmarks.envs_learning --only delivery` has kept, or `--training` names.
"""

# pyright: reportInvalidTypeForm=false, reportGeneralTypeIssues=false, reportAssignmentType=false
# a kernel is Warp code, whose annotations are values

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from scipy.stats import binomtest

from benchmarks.envs_learning import CARRIED, Trained
from benchmarks.envs_played import OUT
from benchmarks.report import commit, positive, run, save_page
from benchmarks.validation import put_on_page
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.envs.experts.delivery import SPEED_LIMIT, Carrier
from otwarp.envs.experts.policies import Seen
from otwarp.envs.observer import Observer
from otwarp.envs.registration import task_of
from otwarp.envs.task import Policy
from otwarp.errors import InputError
from otwarp.operators.kernels.chain_data import MotionState
from otwarp.operators.kernels.types import TaskData
from otwarp.operators.loop import Loop
from otwarp.operators.study import OperatorStudy
from otwarp.operators.task import OUTCOMES, REACHED, Task
from otwarp.scene import Scene

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "envs_learning.md"
BEGIN, END = "<!-- begin envs_learning {} -->", "<!-- end envs_learning {} -->"
AUTHORITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
RATE = 20.0
"""Decisions of the policy a second [Hz]."""
LOOK = 5
"""Decisions between looks whether anybody is still at work."""
CUBE, NEAR_CUBE = "/World/Obstacles/cube_2", 110.0
"""A moving obstacle, and how far along the path a cell is just before it [µm]."""
CHANGED = ("nothing", f"no {CUBE.rsplit('/', 1)[-1]}", "operators correct nothing that they see")
"""What differs in the trials that say why robots are lost."""
PARTS = ("operators", "reasons", "trained")


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

    def look(self) -> Seen:
        """What the policy sees."""
        place = self.sim.state.position.numpy()[:, self.task.cell]
        seen = {f"body_position.{axis}": place[:, i].astype(float) for i, axis in enumerate("xy")}
        return {**seen, "time_left": self.task.duration - self.sim.episodes.time}

    def decide(self, *, first: bool) -> None:
        """Let the policy look, and lend its velocities; a hand's vector longer than 1 counts as one of length 1."""
        worlds = self.sim.model.worlds
        action = self.policy(self.look(), np.full(worlds, first)).reshape(worlds, -1, 2)
        action = action / np.maximum(np.linalg.norm(action, axis=2, keepdims=True), 1.0)
        velocity = np.zeros((worlds, len(self.task.plans), 3))
        velocity[:, :, :2] = SPEED_LIMIT * action
        self.lent.assign(velocity)

    def finish(self, carrier: Carrier) -> np.ndarray:
        """Go on until nobody is at work any more.

        Args:
            carrier: The policy, which knows how far cells have come.

        Returns:
            (W) times at which cells came near the cube [s], NaN for never.
        """
        decisions, arrived = 0, np.full(self.sim.model.worlds, np.nan)
        while decisions % LOOK or self.running:
            self.decide(first=decisions == 0)
            arrived[np.isnan(arrived) & (carrier.done >= NEAR_CUBE)] = decisions / RATE
            self.run(1.0 / RATE)
            decisions += 1
        return arrived


class LearntLoop(SharedLoop):
    """The same with a policy that sees all that an environment of `CellDelivery` shows."""

    def look(self) -> Seen:
        """What the environment would show."""
        seen = self.observer.look()
        return {column.name: column.scale * seen[:, n] for n, column in enumerate(self.observer.layout.seen)}

    def prepare(self, local: Any) -> None:
        """As `SharedLoop`."""
        super().prepare(local)
        self.observer = Observer(task_of(CARRIED), self.sim)

    def deliver(self) -> None:
        """Go on until nobody is at work any more."""
        decisions = 0
        while decisions % LOOK or self.running:
            self.decide(first=decisions == 0)
            self.run(1.0 / RATE)
            decisions += 1


def study(operators: int, condition: str, without: str = "") -> OperatorStudy:
    """Who takes part, in the shipped scene or in one without an obstacle."""
    scene = Scene.load(ROOT / "scenes" / "cell_delivery.usda")
    scene = replace(scene, obstacles=tuple(o for o in scene.obstacles if o.prim != without))
    return OperatorStudy(scene=scene, operators=operators, seed=1, conditions=(condition,), chunk=operators)


def trials(
    asked: OperatorStudy, authority: float, device: str, *, correct: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """(n) outcomes of all operators, and times at which their cells came near the cube [s]."""
    task, people = asked.task, asked.persons(np.arange(asked.count))
    if not correct:
        people["correction"] = 0.0
    speed = float(np.linalg.norm(np.diff(task.path[0], axis=0), axis=1).sum() / task.end)
    carrier = Carrier(speed=speed)
    loop = SharedLoop(task, people, carrier, authority, **how_of(asked, device))
    arrived = loop.finish(carrier)
    return loop.sim.episodes.done.numpy(), arrived


def how_of(asked: OperatorStudy, device: str) -> dict[str, Any]:
    """What a loop takes of a study."""
    return {"seed": asked.seed, "device": device, "time_step": asked.time_step, "frame_rate": asked.frame_rate}


def learnt_trials(asked: OperatorStudy, policy: Policy, authority: float, device: str) -> tuple[np.ndarray, np.ndarray]:
    """(n) outcomes of all operators beside a trained policy, and times of deliveries [s], NaN for none."""
    people = asked.persons(np.arange(asked.count))
    loop = LearntLoop(asked.task, people, policy, authority, **how_of(asked, device))
    loop.deliver()
    outcome = loop.sim.episodes.done.numpy()
    return outcome, np.where(outcome == REACHED, loop.sim.episodes.time, np.nan)


def row(first: str, second: str, outcome: np.ndarray, arrived: np.ndarray) -> str:
    """A line of a table for (n) outcomes and arrivals [s]."""
    good, count = int(np.count_nonzero(outcome == REACHED)), len(outcome)
    rate, interval = good / count, binomtest(good, count).proportion_ci(0.95, method="exact")
    error = np.sqrt(rate * (1.0 - rate) / count)
    failed = [code for code in np.unique(outcome) if code != REACHED]
    others = ", ".join(f"{OUTCOMES[code]} {np.count_nonzero(outcome == code)}" for code in failed)
    delivered = f"{rate:.3f} [{interval.low:.3f}, {interval.high:.3f}]"
    came = arrived[~np.isnan(arrived)]
    when = " to ".join(f"{t:.1f}" for t in np.quantile(came, (0.25, 0.75))) if len(came) else "–"
    return f"| {first} | {second} | {delivered} | {error:.3f} | {others or '–'} | {when} |"


def head(first: str, second: str, operators: int, until: str = "the cube") -> list[str]:
    """Head of a table."""
    return [
        f"| {first} | {second} | delivered of {operators}, 95 % interval | standard error | how the others ended | "
        f"s to {until}, middle half |",
        "|---|---|---:|---:|---|---:|",
    ]


def table(operators: int, device: str) -> str:
    """Deliveries by authority, with and without haptics."""
    lines = head("share of the policy", "haptics", operators)
    for condition in ("without", "with"):
        for authority in AUTHORITIES:
            print(f"{condition}, {authority:g}", flush=True)
            lines.append(row(f"{authority:.2f}", condition, *trials(study(operators, condition), authority, device)))
    return "\n".join(lines)


def trained_table(operators: int, device: str, training: Path) -> str:
    """Deliveries by authority of a trained policy, with and without haptics."""
    weights = training / "policy.pt"
    if not weights.is_file():
        raise InputError(f"{weights}: no such file; allowed: a folder of examples/train_ppo.py at {CARRIED}")
    policy = Trained(weights, task_of(CARRIED))
    lines = head("share of the policy", "haptics", operators, "the goal")
    for condition in ("without", "with"):
        for authority in AUTHORITIES:
            print(f"trained, {condition}, {authority:g}", flush=True)
            found = learnt_trials(study(operators, condition), policy, authority, device)
            lines.append(row(f"{authority:.2f}", condition, *found))
    return "\n".join(lines)


def reasons(operators: int, device: str, authority: float = 0.75) -> str:
    """Why robots are lost at one authority: the same with one thing changed."""
    lines = head("what is changed", "haptics", operators)
    for condition in ("without", "with"):
        for changed in CHANGED:
            print(f"{condition}, {changed}", flush=True)
            asked = study(operators, condition, without=CUBE if changed == CHANGED[1] else "")
            found = trials(asked, authority, device, correct=changed != CHANGED[2])
            lines.append(row(changed, condition, *found))
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Shared control with full SIMULATED operators at the cell delivery.")
    parser.add_argument("--only", choices=PARTS, nargs="+", default=PARTS, help="tables (default: all)")
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--operators", type=positive, default=64, help="each at every share (default: 64)")
    parser.add_argument(
        "--training", type=Path, default=OUT / "delivery_cuda_0",
        help="folder of examples/train_ppo.py with the policy (default: out/envs_learning/delivery_cuda_0)",
    )  # fmt: skip
    parser.add_argument("--write", action="store_true", help=f"write docs/benchmarks/{PAGE.name}")
    given = parser.parse_args()
    where = f"Commit {commit()}, {Machine.look(pick_device(given.device)).name()}."
    makes = {
        "operators": lambda: table(given.operators, given.device),
        "reasons": lambda: reasons(given.operators, given.device),
        "trained": lambda: trained_table(given.operators, given.device, given.training),
    }
    for name in given.only:
        text = f"{makes[name]()}\n\n{where}"
        print(text, flush=True)
        # read anew: a table takes minutes
        page = put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN.format(name), END.format(name))
        if given.write:
            save_page(PAGE, page)


if __name__ == "__main__":
    run(main)
