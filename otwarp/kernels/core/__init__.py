"""What every kernel is written with.

types (the structs that kernels read and write; open this first), features (what a scene needs), medium, random and
noise, rotation, roots, cells and reads, faults, key frames, the signature of `Dynamics`, and `precision`, which makes
float64 kernels from float32 ones. Imports nothing of the other rooms.
"""
