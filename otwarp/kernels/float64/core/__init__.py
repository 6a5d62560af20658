"""The random numbers, roots and cells of float64 kernels, which cannot be made from those of float32.

Each file stands for the one of its name in `kernels.core`: cells, noise, random, roots, rounding. Open random first.
"""
