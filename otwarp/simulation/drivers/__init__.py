"""Who launches the kernels of a step, and the memory that they work on: a driver for few bodies, and two for many.

In: a `Model` with its features, `State`, `Control` and `Readout`. Out: the same state, so many steps later.

| file | what it holds |
|---|---|
| `stepping` | fused drivers, and the phases of a step as a graph; open it first |
| `grid_stepper`, `block_stepper` | many bodies on a grid: a launch a stage, or a block of threads a world |
| `grid_phases_stepper` | on GPUs, many worlds of some hundred bodies: a launch a part of the step, a team a world |
| `world_scratch`, `grid_scratch` | memory of a thread's world; of the grid |
| `compilation` | loads kernels, says what a GPU keeps for them |
| `launches` | launches that are packed once and replayed |
"""
