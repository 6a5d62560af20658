"""Environments as libraries for learning want them; each file needs its own, and is imported by name. Open `sb3` first.

sb3       Stable-Baselines3's `VecEnv`
skrl      skrl's wrapper
rsl_rl    rsl_rl's `VecEnv`, on a TensorDict

Tensors stay on the device of the environments. What is seen, earned and flagged is cloned there by `skrl` and `rsl_rl`,
whose algorithms keep it across the next step, which writes on the same memory.

Loops in the style of CleanRL take a `VectorEnv` as it is: `examples/train_ppo.py`.
"""
