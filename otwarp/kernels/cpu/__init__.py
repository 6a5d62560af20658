"""Vector blocks of a CPU: code that is written for lanes because Warp compiles kernels for CPUs as scalar code.

noise_block draws the deviates of 16 steps at once, rigid_block multiplies with a body's mobility, table_block sums a
body's forces in bilinear tables, pair_block finds spheres that are near each other, move_block moves 16 of them,
law_block sums the laws of some contacts. They compute what scalar functions elsewhere compute, in float32; CUDA has no
use for them. Open noise_block first.
"""
