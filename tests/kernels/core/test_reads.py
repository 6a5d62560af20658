"""Reads without strides, against NumPy."""

import numpy as np
import warp as wp

from otwarp.kernels.core.reads import (
    index_at,
    mat66_at,
    number_at,
    pair_at,
    pitch_of,
    put_pair,
    put_real,
    put_vec2,
    put_vec4,
    real_at,
    vec2_at,
    vec4_at,
    vec4_of,
    vec4i_of,
)
from otwarp.kernels.core.types import mat66


@wp.kernel(enable_backward=False)
def read_all(
    rows: wp.array(dtype=wp.vec4), indices: wp.array(dtype=wp.int32), table: wp.array2d(dtype=wp.float32),
    row: wp.array(dtype=wp.vec4), index: wp.array(dtype=wp.int32), number: wp.array2d(dtype=wp.float32),
):  # fmt: skip
    """Copy three arrays by the functions under test."""
    i = wp.tid()
    row[i] = vec4_at(rows, i)
    index[i] = index_at(indices, i)
    for j in range(table.shape[1]):
        number[i, j] = number_at(table, i, j)


def test_reads_are_those_of_numpy(device):
    rng = np.random.default_rng(1)
    n = 37
    rows, indices = rng.normal(size=(n, 4)).astype(np.float32), rng.integers(0, 99, n).astype(np.int32)
    table = rng.normal(size=(n, 5)).astype(np.float32)
    given = [wp.array(rows, dtype=wp.vec4, device=device), wp.array(indices, device=device)]
    given.append(wp.array(table, device=device))
    out = [wp.zeros_like(array) for array in given]
    wp.launch(read_all, dim=n, inputs=given, outputs=out, device=device)
    for array, expected in zip(out, (rows, indices, table), strict=True):
        np.testing.assert_array_equal(array.numpy(), expected)


@wp.kernel(enable_backward=False)
def turn_over(rows: wp.array2d(dtype=wp.vec4), out: wp.array2d(dtype=wp.vec4)):
    """Each row backwards."""
    i = wp.tid()
    row = rows[i]
    back = out[i]
    length = rows.shape[1]
    for j in range(length):
        put_vec4(back, (length - 1 - j) * pitch_of(back), vec4_at(row, j * pitch_of(row)))


def test_rows_of_other_strides_are_those_of_numpy(device):
    """One world's entries of an array in which those of neighbouring worlds lie side by side."""
    numbers = np.random.default_rng(2).normal(size=(7, 5, 4)).astype(np.float32)
    rows, out = (wp.array(np.swapaxes(n, 0, 1), dtype=wp.vec4, device=device).transpose()
                 for n in (numbers, np.zeros_like(numbers)))  # fmt: skip
    wp.launch(turn_over, dim=7, inputs=[rows], outputs=[out], device=device)
    np.testing.assert_array_equal(out.numpy(), numbers[:, ::-1])


@wp.kernel(enable_backward=False)
def copy_entries(
    pairs: wp.array(dtype=wp.vec2i), twos: wp.array(dtype=wp.vec2), reals: wp.array(dtype=float),
    pair: wp.array(dtype=wp.vec2i), two: wp.array(dtype=wp.vec2), real: wp.array(dtype=float),
):  # fmt: skip
    """Three arrays backwards."""
    i = wp.tid()
    last = reals.shape[0] - 1 - i
    put_pair(pair, last, pair_at(pairs, i))
    put_vec2(two, last, vec2_at(twos, i))
    put_real(real, last, real_at(reals, i))


def test_entries_are_those_of_numpy(device):
    rng = np.random.default_rng(4)
    numbers = rng.integers(0, 99, (5, 2)).astype(np.int32), rng.normal(size=(5, 2)), rng.normal(size=5)
    given = [wp.array(n, dtype=t, device=device) for n, t in zip(numbers, (wp.vec2i, wp.vec2, float), strict=True)]
    out = [wp.zeros_like(array) for array in given]
    wp.launch(copy_entries, dim=5, inputs=given, outputs=out, device=device)
    for array, copied in zip(given, out, strict=True):
        np.testing.assert_array_equal(copied.numpy(), array.numpy()[::-1])


@wp.kernel(enable_backward=False)
def copy_matrices(rows: wp.array(dtype=mat66), out: wp.array(dtype=mat66)):
    i = wp.tid()
    out[i] = mat66_at(rows, i)


def test_matrices_are_those_of_numpy(device):
    numbers = np.random.default_rng(3).normal(size=(5, 6, 6)).astype(np.float32)
    rows, out = (wp.array(n, dtype=mat66, device=device) for n in (numbers, np.zeros_like(numbers)))
    wp.launch(copy_matrices, dim=5, inputs=[rows], outputs=[out], device=device)
    np.testing.assert_array_equal(out.numpy(), numbers)


@wp.kernel(enable_backward=False)
def read_fours(
    rows: wp.array2d(dtype=wp.vec4), indices: wp.array2d(dtype=wp.vec4i), row: wp.array2d(dtype=wp.vec4),
    index: wp.array2d(dtype=wp.vec4i),
):  # fmt: skip
    """Copy two tables of fours."""
    i, j = wp.tid()
    row[i, j] = vec4_of(rows, i, j)
    index[i, j] = vec4i_of(indices, i, j)


def test_fours_of_a_table(device):
    rng = np.random.default_rng(5)
    given = [
        wp.array(rng.normal(size=(6, 7, 4)).astype(np.float32), dtype=wp.vec4, device=device),
        wp.array(rng.integers(-9, 1 << 30, (6, 7, 4)).astype(np.int32), dtype=wp.vec4i, device=device),
    ]
    out = [wp.zeros_like(array) for array in given]
    wp.launch(read_fours, dim=(6, 7), inputs=given, outputs=out, device=device)
    for array, expected in zip(out, given, strict=True):
        np.testing.assert_array_equal(array.numpy(), expected.numpy())
