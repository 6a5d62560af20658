"""PPO of skrl in the environments of otwarp: `python examples/train_skrl.py otwarp/Navigate-v0 2000`.

You see its progress, and in how many environments the last episode succeeded; checkpoints are not written.
"""

from __future__ import annotations

import argparse
from typing import Any

import torch
from skrl.agents.torch import ExperimentCfg
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer
from torch import nn

from otwarp.envs import VectorEnv, task_of
from otwarp.envs.adapters.skrl import SkrlEnv
from otwarp.errors import in_one_line


class Actor(GaussianMixin, Model):
    """A Gaussian over actions."""

    def __init__(self, env: SkrlEnv):
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        GaussianMixin.__init__(self)
        self.layers = layers(self.num_observations, self.num_actions)
        self.log_deviation = nn.Parameter(torch.full((self.num_actions,), -0.5))

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """Mean, and logarithm of the standard deviation."""
        return self.layers(inputs["observations"]), {"log_std": self.log_deviation}


class Critic(DeterministicMixin, Model):
    """The value of what is seen."""

    def __init__(self, env: SkrlEnv):
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        DeterministicMixin.__init__(self)
        self.layers = layers(self.num_observations, 1)

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """The value."""
        return self.layers(inputs["observations"]), {}


def layers(seen: int, out: int) -> nn.Sequential:
    """Two hidden layers of 64."""
    return nn.Sequential(nn.Linear(seen, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, out))


def train(name: str, steps: int, envs: int = 64, rollout: int = 64) -> tuple[PPO, SkrlEnv]:
    """Train for some steps of each environment."""
    env = SkrlEnv(VectorEnv(task_of(name), envs, device="cpu", arrays="torch", autoreset_mode="SameStep"), seed=0)
    agent = PPO(
        models={"policy": Actor(env).to(env.device), "value": Critic(env).to(env.device)},
        memory=RandomMemory(memory_size=rollout, num_envs=envs, device=env.device),
        observation_space=env.observation_space,
        action_space=env.action_space,
        device=env.device,
        cfg=PPO_CFG(
            rollouts=rollout,
            mini_batches=4,
            learning_rate=1e-3,
            entropy_loss_scale=0.002,
            experiment=ExperimentCfg(write_interval=0, checkpoint_interval=0),
        ),
    )
    SequentialTrainer(env=env, agents=agent, cfg={"timesteps": steps, "headless": True}).train()
    return agent, env


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Train a policy by PPO of skrl.")
    parser.add_argument("env", nargs="?", default="otwarp/Navigate-v0")
    parser.add_argument("steps", nargs="?", type=int, default=2000)
    args = parser.parse_args()
    with in_one_line("train_skrl"):
        _, trained = train(args.env, args.steps)
        won = int(trained.succeeded.sum())
        print(f"the last episode succeeded in {won} of {trained.num_envs} environments")
