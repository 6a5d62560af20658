"""`python -m benchmarks.envs_learning [--write]`: what scripts and trained policies achieve at the shipped tasks.

Every script plays new episodes of its task; PPO of `examples/train_ppo.py` learns Navigate from several seeds, one
after the other, and is judged on other new episodes. Results are kept in out/envs_learning, where it goes on if it was
interrupted. `--write` puts the tables between the markers of docs/benchmarks/envs_learning.md, and the picture of the
learning curves into docs/images.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.envs_played import OUT, Table, others_of, rate_of, time_of
from benchmarks.report import commit, positive, run, save_page
from benchmarks.validation import put_on_page
from examples import train_ppo
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.envs.experts.delivery import Carrier
from otwarp.envs.experts.navigate import ShortestPath, StraightLine
from otwarp.envs.experts.operator import Operator, Shared
from otwarp.envs.experts.policies import RandomPolicy, Seen
from otwarp.envs.experts.push import Pusher
from otwarp.envs.experts.servo import ConstantPower, PowerServo, SpacingServo
from otwarp.envs.experts.strides import STRIDE, Strider
from otwarp.envs.layout import Layout
from otwarp.envs.registration import task_of
from otwarp.envs.task import Policy, Task
from otwarp.files import written
from otwarp.operators.population import load_population

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "envs_learning.md"
BEGIN, END = "<!-- begin envs_learning {} -->", "<!-- end envs_learning {} -->"
LEARNT, CARRIED = "otwarp/Navigate-v0", "otwarp/CellDelivery-v0"
PICTURES = {
    LEARNT: ROOT / "docs" / "images" / "envs_learning.png",
    CARRIED: ROOT / "docs" / "images" / "envs_delivery.png",
}
TARGET = 0.985
"""Success of the last 1,000 episodes of a training, with exploration, at which it stops."""
PARTS = ("ppo", "scripts", "shared", "noise", "delivery")
LOAD = re.compile(r"load (\d+\.?\d*)")
"""What a result says of the machine that differs from seed to seed."""

AUTHORITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
OPERATOR_SPEED = 25.0
"""At which simulated operators move the trap [µm/s]."""

SCRIPTS: dict[str, dict[str, Callable[[], Policy]]] = {
    LEARNT: {
        "random": lambda: RandomPolicy(2),
        "straight line, 40 µm/s": StraightLine,
        "shortest path on a grid (A*), 40 µm/s": ShortestPath,
        "the same, 55 µm/s": lambda: ShortestPath(speed=55.0),
    },
    "otwarp/Push-v0": {"random": lambda: RandomPolicy(2), "round the cell, then against it": Pusher},
    "otwarp/Hold-v0": {
        "random": lambda: RandomPolicy(1),
        **{f"always {power:g} mW": lambda power=power: ConstantPower(power) for power in (0.4, 0.6, 0.8, 1.0)},
        "power by the distance from the trap": PowerServo,
    },
    "otwarp/Orient-v0": {"random": lambda: RandomPolicy(2), "spacing by the error of the height": SpacingServo},
    "otwarp/CellDelivery-v0": {
        "random": lambda: RandomPolicy(4),
        "both hands on the path, 19 µm/s": Carrier,
        "the same, 24 µm/s": lambda: Carrier(speed=24.0),
        "the same, 28 µm/s": lambda: Carrier(speed=28.0),
    },
    "otwarp/CellDeliveryOTGym-v0": {
        "random of its ten choices": lambda: Strider(None),
        "always choice 6, 3.3 µm a step": Strider,
        **{f"always choice {n}, {STRIDE * n:.3g} µm a step": lambda n=n: Strider(n) for n in (7, 8, 9)},
    },
}
"""Scripts by task."""


NOISES = ((0.05, 0.05), (0.1, 0.1), (0.4, 0.4), (0.4, 0.0), (0.0, 0.03), (0.4, 0.008))
"""Standard deviations that are added to the common velocity of both hands and to their relative one [1]."""


class Noisy:
    """A policy for two hands, with noise that is drawn anew in every period.

    Args:
        policy: For four numbers.
        common: Standard deviation of what both hands get of it, along each axis.
        relative: And of what one hand gets and the other loses.
        seed: Of the generator.
    """

    def __init__(self, policy: Policy, common: float, relative: float, seed: int = 0):
        self.policy, self.common, self.relative = policy, common, relative
        self.generator = np.random.default_rng(seed)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 4) actions."""
        both, apart = self.generator.normal(size=(2, len(fresh), 2))
        both, apart = self.common * both, self.relative * apart
        return self.policy(seen, fresh) + np.concatenate([both + apart, both - apart], axis=1)


def noise_table(episodes: int, device: str) -> str:
    """The script of the cell delivery with noise on the velocities of its hands."""
    task = task_of(CARRIED)
    table = Table(
        f"| noise: common, relative (1 is 30 µm/s) | success in {episodes} episodes, 95 % interval | mean length | "
        "how the others ended |",
        "|---|---:|---:|---|",
        device,
    )
    for common, relative in NOISES:
        make = lambda common=common, relative=relative: Noisy(Carrier(), common, relative)  # noqa: E731
        found = table.played(task, f"noise {common:g} {relative:g}", make, episodes)
        length = f"{found.periods.mean() / task.rate:.1f} s"
        table.lines.append(f"| {common:g}, {relative:g} | {rate_of(found)} | {length} | {others_of(task, found)} |")
    return str(table)


def scripts_table(episodes: int, device: str) -> str:
    """Successes of every script."""
    table = Table(
        f"| task | script | success in {episodes} episodes, 95 % interval | s to success | how the others ended |",
        "|---|---|---:|---:|---|",
        device,
    )
    for name, scripts in SCRIPTS.items():
        for said, make in scripts.items():
            task = task_of(name)
            found = table.played(task, f"{name} {said}", make, episodes)
            counted = f"{rate_of(found)} | {time_of(task, found)} | {others_of(task, found)}"
            table.lines.append(f"| `{name}` | {said} | {counted} |")
    return str(table)


def learnt(
    env: str, seed: int, minutes: float, device: str, **more: Any
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Result and curve of one training, done now if it has not been; `more` are options of `train_ppo`."""
    folder = OUT / f"{kind_of(env, device)}_{seed}"
    if not is_whole(folder / "result.json"):
        asked = {"env": env, "seed": seed, "minutes": minutes, "target": TARGET, "device": device, "out": folder} | more
        result = train_ppo.main([word for name, value in asked.items() for word in (f"--{name}", str(value))])
        machine = Machine.look(pick_device(device))
        where = f"Commit {commit()}, {machine.name()}, {machine.cores} cores, load {machine.load} at the end."
        with written(folder / "result.json", "result.json") as part:
            part.write_text(json.dumps({**result, "where": where}, indent=1), encoding="utf-8")
    read = [json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in ("result", "curve")]
    return read[0], read[1]


def is_whole(file: Path) -> bool:
    """Whether a result says where it was measured: that is written last, and a process may have been killed before."""
    try:
        return "where" in json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, json.JSONDecodeError):
        return False


def kind_of(env: str, device: str) -> str:
    """Name of the trainings of an environment: those of the cell delivery on a GPU stand beside those on a CPU."""
    if env == LEARNT:
        return "seed"
    return "delivery_cuda" if device.startswith("cuda") else "delivery"


def learnt_table(trainings: dict[int, tuple[dict[str, Any], list[dict[str, Any]]]]) -> str:
    """What came of each seed, and when its success in training first came to 0.95."""
    lines = [
        "| seed | success without exploration, 95 % interval | episodes | 0.95 in training after | steps | wall time | "
        "processor time |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for seed, (result, curve) in trainings.items():
        first = next((row for row in curve if row["success"] >= 0.95), None)
        after = "never" if first is None else f"{first['steps']:,} steps, {first['wall']:.0f} s"
        lines.append(
            f"| {seed} | {result['success']:.3f} [{result['low']:.3f}, {result['high']:.3f}] | {result['episodes']} | "
            f"{after} | {result['steps']:,} | {result['wall']:.0f} s | {result['processor']:.0f} s |"
        )
    return "\n".join(lines)


class Trained:
    """A policy of `examples/train_ppo.py`, without exploration.

    Args:
        path: Its weights.
        task: What it was trained at.
    """

    def __init__(self, path: Path, task: Task):
        self.policy, self.columns = train_ppo.load(path), Layout(task, task.load()).seen

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, A) actions."""
        scaled = np.stack([seen[c.name] / c.scale for c in self.columns], axis=1)
        return self.policy.best(torch.as_tensor(scaled.astype(np.float32))).numpy()


def shared_table(episodes: int, device: str) -> str:
    """A trained policy and SIMULATED operators, who share control of Navigate."""
    task, population = task_of(LEARNT), load_population()
    drawn = dict(zip(population.names, population.draw(0, np.arange(episodes)).T, strict=True))
    traits = {"delay": drawn["visual_delay"], "interval": drawn["interval"], "noise": drawn["motor_noise"]}
    table = Table(
        f"| share of the policy | success in {episodes} episodes, 95 % interval | s to success | "
        "how the others ended |",
        "|---:|---:|---:|---|",
        device,
    )
    for authority in AUTHORITIES:
        operator = Operator(ShortestPath(speed=OPERATOR_SPEED, margin=2.0, spacing=3.0), task.rate, **traits)
        mixed = Shared(Trained(OUT / "seed_0" / "policy.pt", task), operator, authority)
        found = table.played(task, f"shared {authority:g}", lambda mixed=mixed: mixed, episodes)
        table.lines.append(
            f"| {authority:.2f} | {rate_of(found)} | {time_of(task, found)} | {others_of(task, found)} |"
        )
    return str(table)


def draw(env: str, trainings: dict[int, tuple[dict[str, Any], list[dict[str, Any]]]], path: Path) -> None:
    """Success in training of all seeds over steps; of the cell delivery also what episodes earn."""
    from matplotlib.figure import Figure

    columns = {"success": "success"} | ({"earned": "return"} if env == CARRIED else {})
    figure = Figure(figsize=(6.4, 3.6) if len(columns) == 1 else (9.0, 3.6), layout="constrained")
    panels = figure.subplots(1, len(columns), squeeze=False)[0]
    for axes, (name, said) in zip(panels, columns.items(), strict=True):
        for seed, (_, curve) in trainings.items():
            axes.plot([row["steps"] / 1e6 for row in curve], [row[name] for row in curve], label=f"seed {seed}")
        _mark_scattered(axes, env, next(iter(trainings.values()))[1])
        axes.set(xlabel="environment steps (millions)", ylabel=f"{said}, mean of the last 1,000 episodes")
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.3)
    panels[0].axhline(0.95, color="0.5", linewidth=0.8, linestyle="--")
    panels[0].annotate("0.95", (0.0, 0.955), xycoords=("axes fraction", "data"), xytext=(3, 0),
                       textcoords="offset points", color="0.4", fontsize=8)  # fmt: skip
    panels[0].set_ylim(-0.02, 1.04)
    panels[-1].legend(loc="lower right", fontsize=8)
    figure.suptitle(f"PPO at {env}, with exploration", fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _mark_scattered(axes: Any, env: str, curve: list[dict[str, Any]]) -> None:
    """Shade the steps whose episodes start anywhere."""
    scattered = train_ppo.RECIPES.get(env, {}).get("scattered", 0)
    if scattered:
        end = curve[min(scattered, len(curve)) - 1]["steps"] / 1e6
        axes.axvspan(0.0, end, color="0.92", zorder=0)
        axes.annotate("start: anywhere", (0.01, 0.86), xycoords="axes fraction", color="0.35", fontsize=8)


def trained(env: str, given: argparse.Namespace) -> str:
    """What came of the trainings of one environment; their picture is drawn."""
    carried = env == CARRIED
    seeds, minutes = (given.delivery_seeds, given.delivery_minutes) if carried else (given.seeds, given.minutes)
    more = {"envs": given.delivery_envs} if carried and given.delivery_envs else {}
    trainings = {seed: learnt(env, seed, minutes, given.device, **more) for seed in range(seeds)}
    picture = PICTURES[env]
    picture = picture.with_stem(picture.stem + kind_of(env, given.device).partition("delivery")[2])
    draw(env, trainings, picture if given.write else OUT / picture.name)
    return f"{learnt_table(trainings)}\n\n{places({seed: result['where'] for seed, (result, _) in trainings.items()})}"


def places(where: dict[int, str]) -> str:
    """Commit and machine of the trainings, one line for seeds that share them, with the load that each seed met."""
    seeds: dict[str, list[int]] = {}
    for seed, said in where.items():
        seeds.setdefault(LOAD.sub("load {}", said), []).append(seed)
    lines = []
    for said, alike in seeds.items():
        loads = ", ".join(load[1] for seed in alike if (load := LOAD.search(where[seed])))
        whose = "" if len(seeds) == 1 else f"Seed{'s'[: len(alike) > 1]} {', '.join(map(str, alike))}: "
        lines.append(whose + said.replace("load {}", f"load {loads}"))
    return "  \n".join(lines)


def beside(episodes: int, device: str, play: str) -> str:
    """The policy of seed 0, trained on `device`, beside the script of the cell delivery, in the same new episodes."""
    task = task_of(CARRIED)
    table = Table(
        f"| policy | success in {episodes} episodes, 95 % interval | s to success | how the others ended |",
        "|---|---:|---:|---|",
        play,
    )
    for said, make in (
        ("both hands on the path, 19 µm/s", Carrier),
        ("trained, seed 0", lambda: Trained(OUT / f"{kind_of(CARRIED, device)}_0" / "policy.pt", task)),
    ):
        found = table.played(task, f"{kind_of(CARRIED, device)} {said}", make, episodes)
        table.lines.append(f"| {said} | {rate_of(found)} | {time_of(task, found)} | {others_of(task, found)} |")
    return str(table)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="What scripts and trained policies achieve at the shipped tasks.")
    add = parser.add_argument
    add("--only", choices=PARTS, nargs="+", default=PARTS, help="parts of the page (default: all)")
    add("--device", default="cpu", help="cpu (default) or cuda:0")
    add("--episodes", type=positive, default=256, help="of each script; half as many are shared (256)")
    add("--seeds", type=positive, default=5, help="trainings at Navigate (default: 5)")
    add("--minutes", type=float, default=5.0, help="of wall time for each (default: 5)")
    add("--delivery-seeds", type=positive, default=1, help="trainings at CellDelivery (default: 1)")
    add("--delivery-minutes", type=float, default=50.0, help="of wall time for each (default: 50)")
    add("--delivery-envs", type=int, default=0, help="environments at once; thousands on a GPU (default: the recipe's)")
    add("--play", help="device where the trained policy plays beside the script (default: that of its training)")
    add("--write", action="store_true", help=f"write docs/benchmarks/{PAGE.name} and its pictures")
    given = parser.parse_args()
    if "shared" in given.only:
        learnt(LEARNT, 0, given.minutes, given.device)
    makes: dict[str, Callable[[], str]] = {
        "ppo": lambda: trained(LEARNT, given),
        "scripts": lambda: scripts_table(given.episodes, given.device),
        "shared": lambda: shared_table(max(given.episodes // 2, 1), given.device),
        "noise": lambda: noise_table(given.episodes, given.device),
        "delivery": lambda: (
            f"{trained(CARRIED, given)}\n\n{beside(given.episodes, given.device, given.play or given.device)}"
        ),
    }
    page = PAGE.read_text(encoding="utf-8")
    for name in given.only:
        text = makes[name]()
        print(text, flush=True)
        place = kind_of(CARRIED, given.device) if name == "delivery" else name
        page = put_on_page(page, text, BEGIN.format(place), END.format(place))
        if given.write:
            save_page(PAGE, page)


if __name__ == "__main__":
    run(main)
