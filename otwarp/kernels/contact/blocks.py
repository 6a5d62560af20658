"""Factors of small symmetric positive definite matrices of 3×3 blocks, most of which are zero.

The lower triangle is kept row by row. Bit j of `filled[i]` says that block (i, j) is not zero; others are neither read
nor cleared. Rows are eliminated from the first on, so that bodies which touch one that comes later stay apart.
"""

import warp as wp

from otwarp.kernels.core.roots import reciprocal_root


def block_count(nodes: int) -> int:
    """Blocks of a lower triangle of so many rows, its diagonal included."""
    return nodes * (nodes + 1) // 2


@wp.func
def block_at(i: int, j: int) -> int:
    """Index of block (i, j ≤ i)."""
    return i * (i + 1) // 2 + j


@wp.func
def inverse_root(m: wp.mat33) -> wp.mat33:
    """L⁻¹ of the lower Cholesky factor L of a symmetric positive definite matrix."""
    x = reciprocal_root(m[0, 0])
    yx = m[1, 0] * x
    zx = m[2, 0] * x
    y = reciprocal_root(m[1, 1] - yx * yx)
    zy = (m[2, 1] - zx * yx) * y
    z = reciprocal_root(m[2, 2] - zx * zx - zy * zy)
    below = -yx * x * y
    return wp.mat33(x, 0.0, 0.0, below, y, 0.0, -(zx * x + zy * below) * z, -zy * y * z, z)


@wp.func
def factorise(nodes: int, filled: wp.array(dtype=int), block: wp.array(dtype=wp.mat33)):
    """Cholesky factor in place of the matrix; its diagonal blocks are kept inverted."""
    for j in range(nodes):
        own = block[block_at(j, j)]
        for k in range(j):
            if (filled[j] >> k) & 1 != 0:
                left = block[block_at(j, k)]
                own = own - left * wp.transpose(left)
        inverse = inverse_root(own)
        block[block_at(j, j)] = inverse
        for i in range(j + 1, nodes):
            both = filled[i] & filled[j] & ((1 << j) - 1)
            old = (filled[i] >> j) & 1
            if both != 0 or old != 0:
                value = wp.mat33(0.0)
                if old != 0:
                    value = block[block_at(i, j)]
                for k in range(j):
                    if (both >> k) & 1 != 0:
                        value = value - block[block_at(i, k)] * wp.transpose(block[block_at(j, k)])
                block[block_at(i, j)] = value * wp.transpose(inverse)
                filled[i] = filled[i] | (1 << j)


@wp.func
def solve_factorised(
    nodes: int, filled: wp.array(dtype=int), block: wp.array(dtype=wp.mat33), right: wp.array(dtype=wp.vec3)
):
    """Solution in place of the right-hand sides, by the factor that `factorise` left."""
    for i in range(nodes):
        value = right[i]
        for k in range(i):
            if (filled[i] >> k) & 1 != 0:
                value = value - block[block_at(i, k)] * right[k]
        right[i] = block[block_at(i, i)] * value
    for back in range(nodes):
        i = nodes - 1 - back
        value = right[i]
        for k in range(i + 1, nodes):
            if (filled[k] >> i) & 1 != 0:
                value = value - wp.transpose(block[block_at(k, i)]) * right[k]
        right[i] = wp.transpose(block[block_at(i, i)]) * value
