"""Train a policy by proximal policy optimisation (PPO; Schulman et al. 2017, arXiv:1707.06347), in one file.

    python examples/train_ppo.py --env otwarp/Navigate-v0 --minutes 5 --out out/navigate

You see success grow with steps. All environments are worlds of one simulation: what is seen are tensors on its device.
The folder gets `policy.pt` (weights; `load` makes a policy of them), `curve.json`, `curve.png` and `result.json`, which
says how many new episodes succeeded without exploration.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
from scipy.stats import binomtest
from torch import nn

from otwarp.envs import task_of  # its import registers the environments
from otwarp.errors import InputError, in_one_line
from otwarp.files import check_place

RECIPES: dict[str, dict[str, Any]] = {
    "otwarp/CellDelivery-v0": {
        "pair": 0.02, "log_deviation": -1.0, "normalise": True, "discount": 0.997, "width": 128, "minibatches": 8,
        "envs": 128, "rollouts": 340, "scattered": 150, "minutes": 60.0,
    },
}  # fmt: skip
"""Defaults of options where a task needs others than Navigate."""


class Policy(nn.Module):
    """A Gaussian over actions, or a choice among them, and the value of what is seen.

    Args:
        seen, acted: Numbers of an observation, and of an action or how many choices there are.
        choices: Whether actions are choices.
        width: Of the hidden layers.
        pair: If not 0, the first half of what is drawn is the common velocity of two hands, and the second half times
            this their relative one: independent noise of both hands would open their grip within a second.
        log_deviation: Of what is drawn, at first.
        normalise: Whether what is seen is divided by its deviation so far, less its mean.
    """

    count: torch.Tensor
    mean: torch.Tensor
    variance: torch.Tensor

    def __init__(
        self, seen: int, acted: int, choices: bool = False, width: int = 64, pair: float = 0.0,
        log_deviation: float = -0.5, normalise: bool = False,
    ):  # fmt: skip
        super().__init__()
        self.options = {"seen": seen, "acted": acted, "choices": choices, "width": width, "pair": pair,
                        "normalise": normalise}  # fmt: skip
        self.choices, self.pair, self.normalise = choices, pair, normalise
        self.actor, self.critic = (self._layers(seen, width, out, gain) for out, gain in ((acted, 0.01), (1, 1.0)))
        self.log_deviation = nn.Parameter(torch.full((acted,), log_deviation))
        self.register_buffer("count", torch.tensor(0.0))
        self.register_buffer("mean", torch.zeros(seen))
        self.register_buffer("variance", torch.ones(seen))

    @staticmethod
    def _layers(seen: int, width: int, out: int, gain: float) -> nn.Sequential:
        layers = [nn.Linear(seen, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh(), nn.Linear(width, out)]
        for layer, factor in ((layers[0], 2**0.5), (layers[2], 2**0.5), (layers[4], gain)):
            nn.init.orthogonal_(layer.weight, factor)
            nn.init.zeros_(layer.bias)
        return nn.Sequential(*layers)

    def look(self, seen: torch.Tensor) -> None:
        """Take (…, seen) observations into the mean and variance by which they are normalised."""
        rows = seen.flatten(0, -2)
        share = len(rows) / (self.count + len(rows))
        away = rows.mean(0) - self.mean
        self.variance.lerp_(rows.var(0, correction=0) + (1.0 - share) * away.square(), share)
        self.mean.add_(share * away)
        self.count.add_(len(rows))

    def _normal(self, seen: torch.Tensor) -> torch.Tensor:
        return ((seen - self.mean) / (self.variance + 1e-6).sqrt()).clamp(-5.0, 5.0) if self.normalise else seen

    def distribution(self, seen: torch.Tensor) -> torch.distributions.Distribution:
        """Of what `action` makes actions of."""
        out = self.actor(self._normal(seen))
        if self.choices:
            return torch.distributions.Categorical(logits=out)
        return torch.distributions.Independent(torch.distributions.Normal(out, self.log_deviation.exp()), 1)

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        """(N) expected return."""
        return self.critic(self._normal(seen)).squeeze(-1)

    def action(self, drawn: torch.Tensor) -> torch.Tensor:
        """What the environments take, of what was drawn."""
        if self.choices:
            return drawn.to(torch.int32)
        if self.pair:
            common, relative = drawn.chunk(2, -1)
            drawn = torch.cat([common + self.pair * relative, common - self.pair * relative], -1)
        return drawn.clamp(-1.0, 1.0)

    @torch.no_grad()
    def best(self, seen: torch.Tensor) -> torch.Tensor:
        """Actions without exploration."""
        out = self.actor(self._normal(seen))
        return self.action(out.argmax(-1) if self.choices else out)


def load(path: Path) -> Policy:
    """The policy of a file."""
    saved = torch.load(path, weights_only=True)
    policy = Policy(**saved["options"])
    policy.load_state_dict(saved["weights"])
    return policy


def make(args: argparse.Namespace, **options: Any) -> gym.vector.VectorEnv:
    """The environments, with options of the task; an episode that ends starts anew in the same step."""
    return gym.make_vec(
        args.env, num_envs=args.envs, vectorization_mode="vector_entry_point", device=args.device, arrays="torch",
        autoreset_mode="SameStep", **options,
    )  # fmt: skip


def play(envs: gym.vector.VectorEnv, actions: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """One step: what is seen then, reward, ended, ended by the clock, success, what was seen last."""
    seen, reward, terminated, truncated, info = envs.step(actions)
    # the next step writes on the same memory
    found = (seen, reward, terminated | truncated, truncated, info["success"], info["final_obs"])
    return tuple(value.clone() for value in found)


def collect(envs, policy: Policy, seen: torch.Tensor, earned: torch.Tensor, args: argparse.Namespace):
    """A rollout: tensors (steps, envs, …), what is seen after it, and of episodes that ended in it (n, 2) success and
    what they earned; `earned` (envs) is what those under way have earned so far, and goes on."""
    rows: dict[str, list[torch.Tensor]] = {name: [] for name in ("seen", "action", "log_p", "value", "reward", "over")}
    ended: list[torch.Tensor] = []
    for _ in range(args.steps):
        with torch.no_grad():
            distribution = policy.distribution(seen)
            action = distribution.sample()
            now = {"seen": seen, "action": action, "log_p": distribution.log_prob(action), "value": policy.value(seen)}
            seen, reward, over, cut, success, last = play(envs, policy.action(action))
            earned += reward
            # an episode that the clock has ended would have gone on: what it was still worth counts
            reward = reward + args.discount * torch.where(cut, policy.value(last), 0.0)
        for name, value in {**now, "reward": reward, "over": over.float()}.items():
            rows[name].append(value)
        ended.append(torch.stack([success[over].float(), earned[over]], 1))
        earned[over] = 0.0
    return {name: torch.stack(values) for name, values in rows.items()}, seen, torch.cat(ended)


def advantages(data: dict[str, torch.Tensor], after: torch.Tensor, args: argparse.Namespace) -> torch.Tensor:
    """(steps, envs) generalised advantages (Schulman et al. 2015, arXiv:1506.02438)."""
    result, carried = torch.zeros_like(data["reward"]), torch.zeros_like(after)
    for t in reversed(range(args.steps)):
        goes_on = 1.0 - data["over"][t]
        error = data["reward"][t] + args.discount * goes_on * after - data["value"][t]
        carried = error + args.discount * args.trace * goes_on * carried
        result[t], after = carried, data["value"][t]
    return result


def improve(policy: Policy, optimiser: torch.optim.Optimizer, data, gain: torch.Tensor, args) -> None:
    """Some epochs of clipped gradient steps."""
    flat = {name: value.flatten(0, 1) for name, value in data.items()}
    gain, returns = gain.flatten(), (gain + data["value"]).flatten()
    count = len(gain)
    for _ in range(args.epochs):
        for rows in torch.randperm(count, device=gain.device).chunk(args.minibatches):
            distribution = policy.distribution(flat["seen"][rows])
            ratio = (distribution.log_prob(flat["action"][rows]) - flat["log_p"][rows]).exp()
            better = (gain[rows] - gain[rows].mean()) / (gain[rows].std() + 1e-8)
            surrogate = torch.min(ratio * better, ratio.clamp(1 - args.clip, 1 + args.clip) * better).mean()
            error = (policy.value(flat["seen"][rows]) - returns[rows]).square().mean()
            loss = 0.5 * error - surrogate - args.entropy * distribution.entropy().mean()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
            optimiser.step()


def _past(begun: float, rollouts: int, args: argparse.Namespace) -> float:
    """Share of the training that is over, by the clock or by rollouts."""
    by_clock = (time.perf_counter() - begun) / (60.0 * args.minutes)
    return max(by_clock, rollouts / args.rollouts if args.rollouts else 0.0)


def train(args: argparse.Namespace) -> tuple[Policy, list[dict[str, float]]]:
    """A policy, and a row of its curve for each rollout: success and what is earned are of the last 1,000 episodes."""
    torch.manual_seed(args.seed)
    envs: Any = make(args, **({"start": "anywhere"} if args.scattered else {}))
    choices = hasattr(envs.single_action_space, "n")
    acted = int(envs.single_action_space.n) if choices else envs.single_action_space.shape[0]
    seen = envs.reset(seed=1_000_000 * args.seed)[0].clone()
    how = {name: getattr(args, name) for name in ("width", "pair", "log_deviation", "normalise")}
    policy = Policy(seen.shape[1], acted, choices, **how).to(seen.device)
    earned = torch.zeros(args.envs, device=seen.device)
    optimiser = torch.optim.Adam(policy.parameters(), lr=args.rate, eps=1e-5)
    begun, worked, curve, recent = time.perf_counter(), time.process_time(), [], torch.zeros(0, 2)
    while (past := _past(begun, len(curve), args)) < 1.0 or not curve:
        for group in optimiser.param_groups:
            group["lr"] = args.rate * max(1.0 - past, 0.05)
        if args.scattered and len(curve) == args.scattered:
            envs.close()
            envs, recent = make(args), recent[:0]
            seen, earned = envs.reset(seed=1_000_000 * args.seed)[0].clone(), torch.zeros_like(earned)
        data, seen, ended = collect(envs, policy, seen, earned, args)
        recent = torch.cat([recent, ended.cpu()])[-1000:]
        improve(policy, optimiser, data, advantages(data, policy.value(seen).detach(), args), args)
        if args.normalise:
            policy.look(data["seen"])
        row = {
            "steps": (len(curve) + 1) * args.steps * args.envs,
            "wall": time.perf_counter() - begun,
            "processor": time.process_time() - worked,
            "success": float(recent[:, 0].mean()) if len(recent) else 0.0,
            "earned": float(recent[:, 1].mean()) if len(recent) else 0.0,
            "log_deviation": float(policy.log_deviation.detach().mean()),
        }
        curve.append(row)
        if len(curve) % 10 == 1:
            said = f"success {row['success']:.3f}  earned {row['earned']:6.2f}"
            print(f"{row['steps']:>9,} steps  {row['wall']:5.0f} s  {said}", flush=True)
        if len(curve) > args.scattered and len(recent) == 1000 and row["success"] >= args.target:
            break
    envs.close()
    return policy, curve


def evaluate(policy: Policy, args: argparse.Namespace) -> tuple[int, int]:
    """Successes and episodes: the first one of each environment, of seeds that were never trained with."""
    wins, episodes = 0, 0
    envs = make(args)
    while episodes < args.episodes:
        seen = envs.reset(seed=2_000_000_000 + episodes)[0].clone()
        running = torch.ones(args.envs, dtype=torch.bool, device=seen.device)
        while running.any():
            seen, _, over, _, success, _ = play(envs, policy.best(seen))
            wins += int((success & over & running).sum())
            running &= ~over
        episodes += args.envs
    envs.close()
    return wins, episodes


def draw(curve: list[dict[str, float]], path: Path, title: str) -> None:
    """The learning curve."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.4), layout="constrained")
    axes = figure.subplots()
    axes.plot([r["steps"] / 1000 for r in curve], [r["success"] for r in curve])
    axes.set(xlabel="environment steps (thousands)", ylabel="success of the last 1,000 episodes", title=title)
    axes.set_ylim(-0.02, 1.02)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def parse(argv: list[str] | None = None) -> argparse.Namespace:
    """Options; those of a task's recipe hold where none are given."""
    parser = argparse.ArgumentParser(description="Train a policy by PPO.")
    add = parser.add_argument
    add("--env", default="otwarp/Navigate-v0")
    add("--envs", type=int, default=64, help="environments at once; thousands on a GPU")
    add("--device", default="cpu", help="cpu or cuda:0")
    add("--minutes", type=float, default=5.0, help="of wall time, at most")
    add("--rollouts", type=int, default=0, help="at most; 0: as many as there is time for")
    add("--scattered", type=int, default=0, help="of these, first ones that start anywhere (CellDelivery)")
    add("--target", type=float, default=1.01, help="success in training at which to stop earlier")
    add("--seed", type=int, default=0)
    add("--out", type=Path, default=Path("out/ppo"))
    add("--episodes", type=int, default=512, help="of the evaluation")
    add("--steps", type=int, default=64, help="of a rollout")
    add("--epochs", type=int, default=6)
    add("--minibatches", type=int, default=4)
    add("--rate", type=float, default=1e-3, help="of learning, at first")
    add("--discount", type=float, default=0.99)
    add("--trace", type=float, default=0.95)
    add("--clip", type=float, default=0.2)
    add("--entropy", type=float, default=0.002)
    add("--width", type=int, default=64, help="of the hidden layers")
    add("--pair", type=float, default=0.0, help="if not 0: hands act together, and against each other by this share")
    add("--log-deviation", type=float, default=-0.5, help="of exploration at first, natural logarithm")
    add("--normalise", action=argparse.BooleanOptionalAction, default=False, help="what is seen")
    parser.set_defaults(**RECIPES.get(parser.parse_known_args(argv)[0].env, {}))
    return parser.parse_args(argv)


def check(args: argparse.Namespace) -> None:
    """Refuse options that would fail in the middle, or after an hour of training.

    Raises:
        InputError: There is one.
    """
    least = {"envs": 1, "steps": 1, "episodes": 1, "epochs": 1, "minibatches": 1, "width": 1, "rollouts": 0}
    for name, low in (least | {"scattered": 0, "seed": 0}).items():
        if getattr(args, name) < low:
            raise InputError(f"--{name} is {getattr(args, name)}; allowed: {low} or more")
    if not 0.0 < args.minutes < math.inf:
        raise InputError(f"--minutes is {args.minutes}; allowed: a finite number above 0")
    if args.envs * args.steps < 2 * args.minibatches:
        raise InputError(f"--minibatches is {args.minibatches}; allowed: at most half of --envs times --steps")
    task_of(args.env)
    if args.scattered and args.env not in RECIPES:
        raise InputError(f"--scattered is {args.scattered}; allowed: 0, or with --env {', '.join(RECIPES)}")
    check_place(args.out, "--out", folder=True)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Train, evaluate, save; what `result.json` holds."""
    args = parse(argv)
    check(args)
    policy, curve = train(args)
    wins, episodes = evaluate(policy, args)
    low, high = binomtest(wins, episodes).proportion_ci(0.95, method="exact")
    result = {**curve[-1], "seed": args.seed, "wins": wins, "episodes": episodes, "success": wins / episodes}
    result |= {"low": float(low), "high": float(high)}
    args.out.mkdir(parents=True, exist_ok=True)
    torch.save({"options": policy.options, "weights": policy.cpu().state_dict()}, args.out / "policy.pt")
    (args.out / "curve.json").write_text(json.dumps(curve))
    (args.out / "result.json").write_text(json.dumps(result, indent=1))
    draw(curve, args.out / "curve.png", args.env)
    print(f"success {result['success']:.3f} [{low:.3f}, {high:.3f}] in {episodes} new episodes; look at {args.out}")
    return result


if __name__ == "__main__":
    with in_one_line("train_ppo"):
        main()
