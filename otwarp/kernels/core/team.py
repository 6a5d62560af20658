"""Threads of a GPU that share out one world: neighbours in a warp, which hand values on from register to register.

A step of few worlds lasts as long as its slowest thread: a team works on parts of it side by side, and adds up what
it finds in the order of one thread, so that results are the same. All threads of a team must come by where it votes,
hands on or waits: what decides on that has to be the same in all of them. On a CPU, and in drivers that know no teams,
a team is one thread.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import warp as wp

from otwarp.kernels.core.features import Features

LARGEST = 16
"""Threads of the largest team; others have a power of two of them, too."""


def _native(on_gpu: str, on_cpu: str) -> str:
    """Text of a function that a GPU and a CPU have by different code."""
    return f"#if defined(__CUDA_ARCH__)\n{on_gpu}\n#else\n{on_cpu}\n#endif\n"


@wp.func
def one_thread() -> int:
    """Threads of a team [1] where it is one."""
    return int(1)


@wp.func
def only_lane() -> int:
    """Number [1] of the only thread of its team."""
    return int(0)


@wp.func
def own_value(value: float, lane: int) -> float:
    """The value of the only thread, in its units."""
    return value


@wp.func
def own_bits(bits: int, lane: int) -> int:
    """The integer of the only thread."""
    return bits


@wp.func
def own_vote(flag: bool) -> int:
    """Bit 0: whether the flag is set."""
    return wp.where(flag, 1, 0)


@wp.func
def no_wait():
    """Return at once: a team of one thread has nobody to wait for."""
    return


@dataclass(frozen=True, kw_only=True)
class Team:
    """What the threads that share out a world do together.

    Attributes:
        size, lane: `() -> int`: threads of it, and the number of this one.
        value, bits: `(number, lane) -> number` that a thread has.
        votes: `(flag) -> int`: a bit for each thread.
        wait: `()`: until all are here.
    """

    size: wp.Function
    lane: wp.Function
    value: wp.Function
    bits: wp.Function
    votes: wp.Function
    wait: wp.Function


ALONE = Team(
    size=one_thread, lane=only_lane, value=own_value, bits=own_bits, votes=own_vote, wait=no_wait
)  # fmt: skip


@functools.cache
def together(size: int) -> Team:
    """A team of so many threads, which lie side by side in the warps of a GPU."""
    # the place of the team in its warp, and its threads as bits of the warp
    first = f"(threadIdx.x & {32 - size}u)"
    everyone = f"({(1 << size) - 1}u << {first})"

    @wp.func_native(_native(f"return {size};", "return 1;"))
    def team_size() -> int:
        """Threads of a team [1], a power of two."""
        ...

    @wp.func_native(_native(f"return threadIdx.x & {size - 1};", "return 0;"))
    def team_lane() -> int:
        """Number of this thread in its team, from 0."""
        ...

    @wp.func_native(_native(f"return __shfl_sync({everyone}, value, lane, {size});", "return value;"))
    def team_value(value: wp.float32, lane: int) -> wp.float32:
        """The value that a thread of the team has, in its units."""
        ...

    @wp.func_native(_native(f"return __shfl_sync({everyone}, bits, lane, {size});", "return bits;"))
    def team_bits(bits: int, lane: int) -> int:
        """The integer that a thread of the team has."""
        ...

    @wp.func_native(
        _native(f"return (__ballot_sync({everyone}, flag) >> {first}) & {(1 << size) - 1}u;", "return flag ? 1 : 0;")
    )
    def team_votes(flag: bool) -> int:
        """Bit n: whether the flag is set in thread n of the team."""
        ...

    @wp.func_native(_native(f"__syncwarp({everyone});", ""))
    def team_wait():
        """Wait until the whole team is here and sees what its threads have written."""
        ...

    return Team(
        size=team_size, lane=team_lane, value=team_value, bits=team_bits, votes=team_votes, wait=team_wait
    )  # fmt: skip


def team_of(f: Features) -> Team:
    """Who steps a world: one thread, or on a GPU several."""
    return together(f.team) if f.team > 1 else ALONE


@wp.func_native(_native("return __popc(votes & ((1u << lane) - 1u));", "return lane > 0 ? votes : 0;"))
def count_below(votes: int, lane: int) -> int:
    """How many threads before thread `lane` have voted; on a CPU there is but thread 0."""
    ...


@wp.func_native(_native("return __ffs(votes) - 1;", "return 0;"))
def first_of(votes: int) -> int:
    """The first thread that has voted; votes > 0."""
    ...
