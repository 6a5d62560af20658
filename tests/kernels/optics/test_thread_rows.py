"""Rows of a thread: what one writes, it alone reads, whole or number by number."""

import numpy as np
import warp as wp

from otwarp.kernels.core.features import TURNING_BLOCK
from otwarp.kernels.optics.thread_rows import ROWS, any_beside, number_of, put_row, row_of, rows_at

THREADS = 3 * TURNING_BLOCK


@wp.kernel(enable_backward=False, grid_stride=False, module="unique", launch_bounds=(TURNING_BLOCK,))
def round_trip(whole: wp.array2d(dtype=wp.vec4), number: wp.array2d(dtype=wp.float32)):
    """Fill the rows upwards, read them downwards: row n of thread i is (i, n, bits of 5·i + n, 1)."""
    i = wp.tid()
    room = wp.zeros(shape=(ROWS,), dtype=wp.vec4)
    at = rows_at(room)
    for n in range(whole.shape[1]):
        put_row(at, n, wp.vec4(float(i), float(n), wp.cast(5 * i + n, wp.float32), 1.0))
    for k in range(whole.shape[1]):
        n = whole.shape[1] - 1 - k
        whole[i, n] = row_of(at, n)
        number[i, n] = number_of(at, n, 1)


def test_what_a_thread_writes_it_reads(device):
    """Indices that pass as the bits of a float, too, small and so not normal as these are."""
    whole = wp.zeros((THREADS, ROWS), dtype=wp.vec4, device=device)
    number = wp.zeros((THREADS, ROWS), dtype=wp.float32, device=device)
    wp.launch(round_trip, dim=THREADS, inputs=[whole, number], device=device, block_dim=TURNING_BLOCK)
    i, n = np.meshgrid(np.arange(THREADS), np.arange(ROWS), indexing="ij")
    found = whole.numpy()
    np.testing.assert_array_equal(found[..., 0], i)
    np.testing.assert_array_equal(found[..., 1], n)
    np.testing.assert_array_equal(np.ascontiguousarray(found[..., 2]).view(np.int32), 5 * i + n)
    np.testing.assert_array_equal(number.numpy(), n)


@wp.kernel(enable_backward=False, grid_stride=False)
def ask(about: wp.array(dtype=wp.int32), answer: wp.array(dtype=wp.int32)):
    """Ask beside whom it is so."""
    i = wp.tid()
    answer[i] = wp.where(any_beside(about[i] != 0), 1, 0)


def test_a_warp_is_told_what_one_thread_needs(device):
    """32 threads of a GPU; on a CPU each is alone."""
    about = np.zeros(128, dtype=np.int32)
    about[[3, 70]] = 1
    expected = about.copy()
    if wp.get_device(device).is_cuda:
        expected[:32] = expected[64:96] = 1
    answer = wp.zeros(128, dtype=wp.int32, device=device)
    wp.launch(ask, dim=128, inputs=[wp.array(about, device=device), answer], device=device)
    np.testing.assert_array_equal(answer.numpy(), expected)
