"""The USD side of a recording: frames of one world → `run.usda` over a trajectory and the scene. Open `usd` first.

`prims` says which attributes a frame becomes (poses of prims, instances, trap powers), `force_arrows` adds arrows,
`appearance` the looks, lights and camera that the scene lacks.
"""
