"""PPO of rsl_rl in the environments of otwarp: `python examples/train_rsl_rl.py otwarp/Navigate-v0 40`.

You see in how many environments the last episode succeeded. Its runner reports each rollout if given a `log_dir`.
"""

from __future__ import annotations

import argparse

from rsl_rl.runners import OnPolicyRunner

from otwarp.envs import VectorEnv, task_of
from otwarp.envs.adapters.rsl_rl import RslRlVecEnv
from otwarp.errors import in_one_line

LAYERS = {"class_name": "rsl_rl.models:MLPModel", "hidden_dims": [64, 64], "activation": "tanh"}
GAUSSIAN = {"class_name": "rsl_rl.modules.distribution:GaussianDistribution", "init_std": 0.6}


def train(name: str, rollouts: int, envs: int = 64, steps: int = 64) -> OnPolicyRunner:
    """Train for some rollouts of all environments."""
    env = RslRlVecEnv(VectorEnv(task_of(name), envs, device="cpu", arrays="torch", autoreset_mode="SameStep"), seed=0)
    config = {
        "num_steps_per_env": steps,
        "save_interval": 1000,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "algorithm": {"class_name": "rsl_rl.algorithms:PPO", "learning_rate": 1e-3, "entropy_coef": 0.002},
        "actor": {**LAYERS, "distribution_cfg": GAUSSIAN},
        "critic": {**LAYERS},
    }
    runner = OnPolicyRunner(env, config, device="cpu")
    runner.learn(rollouts)
    return runner


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Train a policy by PPO of rsl_rl.")
    parser.add_argument("env", nargs="?", default="otwarp/Navigate-v0")
    parser.add_argument("rollouts", nargs="?", type=int, default=40)
    args = parser.parse_args()
    with in_one_line("train_rsl_rl"):
        env = train(args.env, args.rollouts).env
        print(f"the last episode succeeded in {int(env.succeeded.sum())} of {env.num_envs} environments")
