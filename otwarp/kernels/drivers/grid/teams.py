"""Teams of threads: those that share out a world wait for each other, and the worlds of a block go together.

A step is more code than a multiprocessor keeps at hand: teams that go through it by themselves wait for instructions
most of the time. So a block holds several teams, which begin each part of a step together (`keep_together`), while
within a part, such as the sweeps over contacts, each waits for its own threads alone.
"""

import warp as wp


@wp.struct
class Lane:
    """What a thread is to a world: `lanes` of them, this one the `lane`-th, share out its bodies."""

    world: int
    lane: int
    lanes: int
    seat: int
    """Which world of its block it is."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return threadIdx.x / lanes;
#else
    return 0;
#endif
""")
def seat_of(lanes: int) -> int:
    """Which team of its block a thread is in, of `lanes` threads each."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    __syncwarp();
    asm volatile("barrier.sync %0, %1;" : : "r"(1 + seat), "r"(lanes) : "memory");
#endif
""")
def wait_for_team(seat: int, lanes: int):
    """Wait until all `lanes` threads of a team are here; whole warps."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    int any;
    __syncwarp();
    asm volatile(
        "{ .reg .pred said, found; setp.ne.s32 said, %3, 0; barrier.red.or.pred found, %1, %2, said;"
        " selp.s32 %0, 1, 0, found; }"
        : "=r"(any) : "r"(1 + seat), "r"(lanes), "r"(said) : "memory");
    return any;
#else
    return said;
#endif
""")
def ask_team(seat: int, lanes: int, said: int) -> int:
    """The same; not 0 if any of them has said so."""
    ...


@wp.func
def meet(me: Lane):
    """Wait until all threads of a world are here."""
    wait_for_team(me.seat, me.lanes)


@wp.func
def any_of(me: Lane, said: int) -> int:
    """Wait until all threads of a world are here; not 0 if any of them has said so."""
    return ask_team(me.seat, me.lanes, said)
