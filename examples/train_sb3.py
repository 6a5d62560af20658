"""PPO of Stable-Baselines3 in the environments of otwarp: `python examples/train_sb3.py otwarp/Navigate-v0 200000`.

You see how many of the last episodes succeeded.
"""

from __future__ import annotations

import argparse

from stable_baselines3 import PPO

from otwarp.envs import VectorEnv, task_of
from otwarp.envs.adapters.sb3 import SB3VecEnv
from otwarp.errors import in_one_line


def train(name: str, steps: int, envs: int = 64, rollout: int = 64) -> PPO:
    """Train for some steps of all environments together."""
    vec = SB3VecEnv(VectorEnv(task_of(name), envs, device="cpu", autoreset_mode="SameStep"))
    model = PPO(
        "MlpPolicy", vec, n_steps=rollout, batch_size=envs * rollout // 4, learning_rate=1e-3, seed=0, device="cpu"
    )
    return model.learn(steps)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Train a policy by PPO of Stable-Baselines3.")
    parser.add_argument("env", nargs="?", default="otwarp/Navigate-v0")
    parser.add_argument("steps", nargs="?", type=int, default=200_000)
    args = parser.parse_args()
    with in_one_line("train_sb3"):
        trained = train(args.env, args.steps)
        wins = list(trained.ep_success_buffer or [])
        print(f"{trained.num_timesteps:,} steps; {sum(wins)} of the last {len(wins)} episodes succeeded")
