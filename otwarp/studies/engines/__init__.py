"""Who computes the blocks of a study, and where.

| file | what it holds |
|---|---|
| `run` | `run_study`: make or find a folder, compute what is missing; open it first |
| `create` | the folder of a study, made as a whole |
| `local` | this process on all its devices, or a share of the blocks |
| `on_ray`, `sent` | the same by Ray; a study as bytes for its workers |
| `ray_internals` | what of Ray is used beyond what it promises |
| `rounds` | a budget of trials, spent in rounds over all points |
| `memory` | how many trials a device has room for at once |
"""
