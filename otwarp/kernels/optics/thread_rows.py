"""Rows of four numbers that a thread keeps over a loop of steps, in the shared memory of a multiprocessor of a GPU.

An entry of an array that is found by its index cannot be in a register. Rows of neighbouring threads lie side by side:
a warp reads one at once. Local arrays would do, but a GPU sets memory aside for those of all threads that it can hold,
however few there are.
"""

import warp as wp

from otwarp.kernels.core.features import TURNING_BLOCK

ROWS = 13
"""Of a thread: seven blocks of threads fit beside each other where a multiprocessor has 100 KiB, and 16 on an H100."""

LOCAL = 1
"""Rows of the local array in place of shared memory on a CPU, where only tests take this form, with `ROWS`."""

_HERE = """
#if defined(__CUDA_ARCH__)
    __shared__ float4 rows[ROWS * BLOCK];
    return __cvta_generic_to_shared(rows + threadIdx.x);
#else
    return (wp::uint64)room.data;
#endif
"""

_READ = """
#if defined(__CUDA_ARCH__)
    float4 row;
    asm volatile("ld.shared.v4.f32 {%0, %1, %2, %3}, [%4];" : "=f"(row.x), "=f"(row.y), "=f"(row.z), "=f"(row.w)
                 : "r"((unsigned)at + 16u * BLOCK * (unsigned)n));
    return {row.x, row.y, row.z, row.w};
#else
    return reinterpret_cast<const wp::vec_t<4, wp::float32>*>(at)[n];
#endif
"""

_READ_ONE = """
#if defined(__CUDA_ARCH__)
    float number;
    asm volatile("ld.shared.f32 %0, [%1];" : "=f"(number) : "r"((unsigned)at + 16u * BLOCK * n + 4u * (unsigned)k));
    return number;
#else
    return reinterpret_cast<const wp::float32*>(at)[4 * n + k];
#endif
"""

_WRITE = """
#if defined(__CUDA_ARCH__)
    asm volatile("st.shared.v4.f32 [%4], {%0, %1, %2, %3};" : : "f"(value[0]), "f"(value[1]), "f"(value[2]),
                 "f"(value[3]), "r"((unsigned)at + 16u * BLOCK * (unsigned)n));
#else
    reinterpret_cast<wp::vec_t<4, wp::float32>*>(at)[n] = value;
#endif
"""


def _sized(source: str) -> str:
    return source.replace("ROWS", str(ROWS)).replace("BLOCK", str(TURNING_BLOCK))


@wp.func_native(_sized(_HERE))
def rows_at(room: wp.array(dtype=wp.vec4)) -> wp.uint64:
    """Where this thread's rows are [1]: on a CPU in the local array `room`."""
    ...


@wp.func_native(_sized(_READ))
def row_of(at: wp.uint64, n: int) -> wp.vec4:
    """Row n, in the units of what it holds."""
    ...


@wp.func_native(_sized(_READ_ONE))
def number_of(at: wp.uint64, n: int, k: int) -> float:
    """Number k of row n, in the units of what it holds."""
    ...


@wp.func_native(_sized(_WRITE))
def put_row(at: wp.uint64, n: int, value: wp.vec4):
    """Write row n, in the units of what it holds."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __any_sync(__activemask(), about);
#else
    return about;
#endif
""")
def any_beside(about: bool) -> bool:
    """Whether it is so in a thread of the warp that is here now: what one of them has to do takes all of them time."""
    ...
