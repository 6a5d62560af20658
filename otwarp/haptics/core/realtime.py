"""What a loop that must be punctual needs: a clock to wait by, and what the operating system grants.

All calls that depend on the operating system stand here. `request_realtime` and its parts never raise: a servo that
gets nothing still runs, with more jitter, and says so. Linux was run; the calls of Windows and macOS are written from
their documentation and were not.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

PRIORITY = 80
"""Of SCHED_FIFO: above the threads of interrupts (50), below those that keep the kernel itself alive (99)."""
NICE = -20
FAVOUR = 10
"""Nice levels by which a live loop goes before others where SCHED_RR is not allowed."""
TIMER_SLACK = 1
"""Nanoseconds by which Linux may delay a sleep; 50,000 by default."""
_PR_SET_TIMERSLACK, _PR_GET_TIMERSLACK = 29, 30
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_RLIMIT_ROOM = 1 << 30
"""Locked memory that the servo may need [bytes]: a lower limit would make later allocations fail."""


class Clock(Protocol):
    """A monotonic clock [s], which stands still while the machine is suspended."""

    def now(self) -> float:
        """Time [s] since an origin of its own."""
        ...

    def sleep_until(self, deadline: float) -> None:
        """Return at `deadline` [s] or as soon as possible after it."""
        ...

    def suspended(self) -> float:
        """For how long the machine has been suspended so far, from an arbitrary start [s]."""
        ...


def next_deadline(deadline: float, period: float, now: float) -> tuple[float, int]:
    """The next deadline after one [s], and how many had passed already: those are dropped, never caught up."""
    deadline += period
    if now < deadline:
        return deadline, 0
    missed = int((now - deadline) / period) + 1
    return deadline + missed * period, missed


class RealClock:
    """`time.perf_counter`, which all processes of a machine share; deadlines are absolute, so errors do not add up.

    Args:
        spin: Last part of a wait that is spent looking at the clock instead of sleeping [s]. Where measured, 100 µs of
            it took 12 µs off the median lateness under SCHED_FIFO, at a tenth of a core; without SCHED_FIFO the
            scheduler punished it with pauses of milliseconds. So it is off unless asked for.
    """

    def __init__(self, spin: float = 0.0):
        self.spin = spin
        self.now: Callable[[], float] = time.perf_counter

    def sleep_until(self, deadline: float) -> None:
        """See `Clock`."""
        rest = deadline - self.spin - time.perf_counter()
        if rest > 0.0:
            time.sleep(rest)
        if self.spin:
            while time.perf_counter() < deadline:
                pass

    def suspended(self) -> float:
        """See `Clock`; 0 where the system does not tell."""
        if not hasattr(time, "CLOCK_BOOTTIME"):
            return 0.0
        return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


class VirtualClock:
    """Time that passes only by waiting, for tests that must give the same result on any machine.

    Args:
        start: First time [s].
        late: How late the k-th wait returns [s], k = 0, 1, …; never, by default.
    """

    def __init__(self, start: float = 0.0, late: Callable[[int], float] | None = None):
        self._now, self._away = start, 0.0
        self._late = late
        self._waits = 0

    def now(self) -> float:
        """See `Clock`."""
        return self._now

    def sleep_until(self, deadline: float) -> None:
        """See `Clock`."""
        late = self._late(self._waits) if self._late else 0.0
        self._waits += 1
        self._now = max(self._now, deadline) + late

    def suspended(self) -> float:
        """See `Clock`."""
        return self._away

    def suspend(self, seconds: float) -> None:
        """Let the machine sleep [s]."""
        self._away += seconds

    def advance(self, seconds: float) -> None:
        """Let time pass, as work does [s]."""
        self._now += seconds


@dataclass(frozen=True, slots=True)
class Grant:
    """One thing asked of the operating system.

    Attributes:
        what: Such as `SCHED_FIFO`.
        granted: Whether it is in force.
        detail: What is in force, or why not.
    """

    what: str
    granted: bool
    detail: str


def request_realtime(priority: int = PRIORITY, *, lock: bool = True, cpu: int | None = None) -> tuple[Grant, ...]:
    """Ask for all that makes a 1 kHz loop of this thread punctual; what was granted, never an error.

    Args:
        priority: Of SCHED_FIFO on Linux, 1 to 99.
        lock: Whether to keep all memory of the process in RAM.
        cpu: Core to stay on; None leaves the choice to the system.
    """
    grants = [schedule(priority), timer()]
    if lock:
        grants.append(lock_memory())
    if cpu is not None:
        grants.append(pin(cpu))
    return tuple(grants)


def schedule(priority: int = PRIORITY) -> Grant:
    """SCHED_FIFO on Linux; the priority class on Windows; the nice value where neither is allowed."""
    if sys.platform == "win32":
        return _attempt("priority class", _windows_priority)
    why = f"{sys.platform} has no SCHED_FIFO for processes"
    if hasattr(os, "sched_setscheduler"):
        fifo = _attempt("SCHED_FIFO", lambda: _fifo(priority))
        if fifo.granted:
            return fifo
        why = f"SCHED_FIFO: {fifo.detail}"
    nice = _attempt("nice", _nice)
    return Grant("nice", nice.granted, f"{nice.detail} ({why})")


def schedule_threads(priority: int) -> Grant:
    """SCHED_FIFO for all threads that this process has by now, and for those that these start; Linux alone.

    The nice value where it is not allowed.
    """
    fifo = _attempt("SCHED_FIFO of all threads", lambda: _fifo_threads(priority))
    return fifo if fifo.granted else _attempt("nice of all threads", _nice_threads)


def favour() -> Callable[[], None]:
    """Let this thread run before ordinary processes, where the system allows it; what is returned takes it back.

    By SCHED_RR at the lowest priority, which nothing that it starts inherits; else by the nice value, which on Linux is
    the thread's as well. Where measured, with a browser that drew by software on both cores, the ticks of a live loop
    took up to 0.5 s at a nice value of −10, and none took 30 ms with SCHED_RR.
    """
    if hasattr(os, "sched_setscheduler"):
        policy, param = os.sched_getscheduler(0), os.sched_getparam(0)
        if _attempt("SCHED_RR", _round_robin).granted:
            return lambda: os.sched_setscheduler(0, policy, param)
    if not hasattr(os, "setpriority"):
        return lambda: None
    before = os.getpriority(os.PRIO_PROCESS, 0)
    if not _attempt("nice", lambda: str(os.setpriority(os.PRIO_PROCESS, 0, before - FAVOUR))).granted:
        return lambda: None
    return lambda: os.setpriority(os.PRIO_PROCESS, 0, before)


def ordinary() -> None:
    """Give up what was inherited from a favoured parent: for processes that may wait."""
    if hasattr(os, "setpriority") and os.getpriority(os.PRIO_PROCESS, 0) < 0:
        _attempt("nice", lambda: str(os.setpriority(os.PRIO_PROCESS, 0, 0)))


def timer() -> Grant:
    """Timer slack of 1 ns on Linux, timer period of 1 ms on Windows."""
    if sys.platform == "linux":
        return _attempt("timer slack", _timer_slack)
    if sys.platform == "win32":
        return _attempt("timer period", _windows_timer)
    return Grant("timer slack", False, f"{sys.platform} has no call for it")


def lock_memory() -> Grant:
    """Keep the process in RAM, so that no page fault of a swapped page stops a cycle."""
    if sys.platform == "linux":
        return _attempt("locked memory", _mlockall)
    return Grant("locked memory", False, f"not asked for on {sys.platform}")


def pin(cpu: int) -> Grant:
    """Keep this process on the core `cpu`; says whether the system granted it."""
    if hasattr(os, "sched_setaffinity"):
        return _attempt("affinity", lambda: _affinity(cpu))
    return Grant("affinity", False, f"{sys.platform} has no call for it")


def parent_is_gone() -> Callable[[], bool]:
    """A cheap test of whether the process that started this one has died.

    On Windows a parent's number stays after its death; there the end of the pipe from the parent has to say it.
    """
    if sys.platform == "win32":
        return lambda: False
    parent = os.getppid()
    return lambda: os.getppid() != parent


def process_ended(pid: int) -> Callable[[float], bool] | None:
    """A cheap test of whether any process has ended, also one that its parent has not taken note of yet.

    It waits for the end for up to so many seconds, and returns at once when it comes. None where the system has no such
    test that is safe against a number that is given anew: only Linux has.
    """
    if not hasattr(os, "pidfd_open"):
        return None
    import select  # of POSIX systems

    try:
        watched = os.pidfd_open(pid)
    except ProcessLookupError:
        return lambda _: True
    except OSError:  # an older kernel, or one that forbids it
        return None
    poll = select.poll()
    poll.register(watched, select.POLLIN)
    return lambda seconds: bool(poll.poll(1e3 * seconds))


def _attempt(what: str, call: Callable[[], str]) -> Grant:
    try:
        return Grant(what, True, call())
    except Exception as error:  # whatever a system's library does, the servo runs
        return Grant(what, False, str(error) or type(error).__name__)


def _fifo(priority: int) -> str:
    # children of the servo, if a device's library starts any, must not inherit it
    policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
    os.sched_setscheduler(0, policy, os.sched_param(priority))
    return f"priority {os.sched_getparam(0).sched_priority}"


def _threads() -> list[int]:
    return [int(entry.name) for entry in os.scandir("/proc/self/task")]


def _fifo_threads(priority: int) -> str:
    threads = _threads()
    for thread in threads:
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    return f"priority {priority} of {len(threads)}"


def _nice_threads() -> str:
    threads = _threads()
    for thread in threads:
        os.setpriority(os.PRIO_PROCESS, thread, NICE)
    return f"{NICE} of {len(threads)}"


def _round_robin() -> str:
    policy = os.SCHED_RR | getattr(os, "SCHED_RESET_ON_FORK", 0)
    os.sched_setscheduler(0, policy, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))
    return "lowest priority"


def _nice() -> str:
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    except PermissionError as error:
        raise PermissionError(f"{error}, stays at {os.getpriority(os.PRIO_PROCESS, 0)}") from None
    return str(os.getpriority(os.PRIO_PROCESS, 0))


def _libc_call(name: str, *arguments: int) -> int:
    import ctypes  # 2 ms, and only where it is needed

    libc = ctypes.CDLL(None, use_errno=True)
    result = getattr(libc, name)(*(ctypes.c_ulong(a) for a in arguments))
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result


def _timer_slack() -> str:
    _libc_call("prctl", _PR_SET_TIMERSLACK, TIMER_SLACK, 0, 0, 0)
    return f"{_libc_call('prctl', _PR_GET_TIMERSLACK, 0, 0, 0, 0)} ns"


def _mlockall() -> str:
    import resource

    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    # root may lock more than the limit says
    if os.geteuid() != 0 and limit != resource.RLIM_INFINITY and limit < _RLIMIT_ROOM:
        raise PermissionError(f"the limit of locked memory is {limit // 1024} KiB (ulimit -l)")
    _libc_call("mlockall", _MCL_CURRENT | _MCL_FUTURE)
    return "all, present and future"


def _affinity(cpu: int) -> str:
    os.sched_setaffinity(0, {cpu})
    return f"core {cpu}"


def _windows_priority() -> str:
    import ctypes

    kernel = ctypes.windll.kernel32  # type: ignore[attr-defined]
    high, time_critical = 0x80, 15
    kernel.GetCurrentProcess.restype = kernel.GetCurrentThread.restype = ctypes.c_void_p
    if not kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), high):
        raise OSError(f"SetPriorityClass: error {kernel.GetLastError()}")
    if not kernel.SetThreadPriority(ctypes.c_void_p(kernel.GetCurrentThread()), time_critical):
        raise OSError(f"SetThreadPriority: error {kernel.GetLastError()}")
    return "HIGH_PRIORITY_CLASS, time-critical thread"


def _windows_timer() -> str:
    import ctypes

    code = ctypes.windll.winmm.timeBeginPeriod(1)  # type: ignore[attr-defined]
    if code != 0:
        raise OSError(f"timeBeginPeriod: error {code}")
    return "1 ms"
