"""Environments as libraries for learning want them; each file needs its own, and is imported by name. Open `sb3` first.

sb3       Stable-Baselines3's `VecEnv`
skrl      skrl's wrapper, without its copies
rsl_rl    rsl_rl's `VecEnv`, on a TensorDict

Loops in the style of CleanRL take a `VectorEnv` as it is: `examples/train_ppo.py`.
"""
