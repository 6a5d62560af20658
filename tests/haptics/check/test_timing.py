"""No wall-clock figure is asserted: a virtual clock says what the numbers must be, and the process only has to work."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from rich.console import Console

from otwarp.cli.haptics.tables import jitter_table
from otwarp.errors import InputError
from otwarp.haptics.check.timing import Jitter, Percentiles, _python, loop_times, measure_jitter
from otwarp.haptics.core.realtime import Grant, VirtualClock


def test_a_punctual_loop_has_no_jitter_and_late_wakes_show_where_they_were():
    periods, latenesses, skipped = loop_times(VirtualClock(), 1000.0, 500)
    assert (max(periods), min(periods), max(latenesses)) == pytest.approx((1e-3, 1e-3, 0.0), abs=1e-12)
    assert skipped == 0
    late = {10: 0.0002, 20: 0.0035}
    periods, latenesses, skipped = loop_times(VirtualClock(late=lambda k: late.get(k, 0.0)), 1000.0, 500)
    assert {k: v for k, v in enumerate(latenesses) if v > 1e-9} == pytest.approx(late)
    assert periods[10] == pytest.approx(0.0012)
    assert periods[11] == pytest.approx(0.0008)
    assert periods[20] == pytest.approx(0.0045)
    assert periods[21] == pytest.approx(0.0005)
    assert skipped == 3


def test_work_that_takes_too_long_skips_deadlines():
    clock = VirtualClock()
    periods, latenesses, skipped = loop_times(clock, 1000.0, 100, lambda: clock.advance(0.0014))
    assert periods[1:] == pytest.approx([0.002] * 99)
    assert max(latenesses) == pytest.approx(0.0, abs=1e-12)
    assert skipped == 99


def test_percentiles_are_nearest_ranks():
    assert Percentiles.of(range(1000, 0, -1)) == Percentiles(500, 990, 999, 1000)
    assert Percentiles.of([3.0]) == Percentiles(3.0, 3.0, 3.0, 3.0)


def test_a_process_measures_and_a_table_shows_it():
    idle = measure_jitter(0.2, 500.0)
    beside = measure_jitter(0.1, 1000.0, busy=1, spin=1e-4, realtime=False)
    assert (idle.cycles, beside.cycles) == (100, 100)
    assert len(idle.grants) == 3
    assert beside.grants == ()
    for one in (idle, beside):
        for spread in (one.period, one.lateness):
            assert 0.0 < spread.p50 <= spread.p99 <= spread.p999 <= spread.max
        assert one.period.max >= 0.9 / one.rate
    console = Console(width=200, record=True)
    console.print(jitter_table([idle, beside]))
    text = console.export_text()
    for word in ("Loop jitter", "idle", "1 busy", "period", "lateness", f"{1e6 * idle.period.max:.0f}", "nothing"):
        assert word in text


def test_what_was_granted_is_in_the_table():
    spread = Percentiles(1e-3, 1e-3, 1e-3, 1e-3)
    grants = (Grant("SCHED_FIFO", True, "priority 80"), Grant("locked memory", False, "limit"))
    console = Console(width=200, record=True)
    console.print(jitter_table([Jitter(1000.0, 1, 0, 0.0, spread, spread, 0, grants)]))
    text = console.export_text()
    assert "SCHED_FIFO priority 80" in text
    assert "locked" not in text


@pytest.mark.parametrize(
    "bad", [{"seconds": 0.0}, {"seconds": 1e9}, {"rate": 0.0}, {"rate": 1e6}, {"busy": -1}, {"spin": 1.0}]
)
def test_arguments_out_of_range_are_one_clear_line(bad):
    with pytest.raises(InputError, match=next(iter(bad))) as error:
        measure_jitter(**bad)
    assert "\n" not in str(error.value)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_an_interrupt_of_the_whole_group_is_one_line():
    """As a terminal sends Ctrl-C: to the command and to the processes that measure for it."""
    program = (
        # a shell starts what runs in the background with interrupts ignored
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from otwarp.cli.main import main\n"
        "from otwarp.haptics.check import timing\n"
        "start = timing._python\n"
        "def python(code):\n"
        "    process = start(code)\n"
        "    print('started', process.pid, file=sys.stderr, flush=True)\n"
        "    return process\n"
        "timing._python = python\n"
        "jitter_only = lambda *_, **__: timing.measure_jitter(60.0)\n"
        "import otwarp.haptics.check as check\n"
        "check.run_check = jitter_only\n"
        "sys.exit(main(['haptics', 'check', '--no-page', '--seconds', '60']))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        lines: list[str] = []
        for line in process.stderr:
            lines.append(line)
            if line.startswith("started"):
                os.killpg(process.pid, signal.SIGINT)
        assert process.wait() == 130
    told = [n for n, line in enumerate(lines) if line.startswith("started")]
    assert len(told) == 1 and lines[told[0] + 1 :] == ["otwarp: interrupted\n"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(lines[told[0]].split()[1]), 0)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no signals of a terminal")
def test_a_process_that_measures_outlives_an_interrupt():
    code = "import os\nos.kill(os.getpid(), signal.SIGINT)\nprint('alive')"
    with _python(code) as process:
        answer, _ = process.communicate()
    assert (answer.decode().strip(), process.returncode) == ("alive", 0)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, set())
