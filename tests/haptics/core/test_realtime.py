from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict

import pytest

from otwarp.haptics.core import realtime
from otwarp.haptics.core.realtime import Grant, parent_is_gone, request_realtime

ASK = """
import json, os
from dataclasses import asdict
from otwarp.haptics.core.realtime import request_realtime
{before}
print(json.dumps([asdict(g) for g in request_realtime(cpu={cpu})]))
print(json.dumps({after}))
"""


def asked(before: str = "", after: str = "0", cpu: int | None = None):
    """What a process of its own got: the one that runs the tests keeps its place."""
    code = ASK.format(before=before, after=after, cpu=cpu)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    grants, value = (json.loads(line) for line in done.stdout.splitlines())
    return {g["what"]: Grant(**g) for g in grants}, value


@pytest.mark.skipif(sys.platform != "linux", reason="reads back what Linux did")
def test_what_is_said_to_be_granted_is_in_force():
    cpu = min(os.sched_getaffinity(0))
    after = "[os.sched_getscheduler(0) & 7, os.sched_getparam(0).sched_priority, sorted(os.sched_getaffinity(0))]"
    grants, (policy, priority, cores) = asked(after=after, cpu=cpu)
    if "SCHED_FIFO" in grants:
        assert grants["SCHED_FIFO"] == Grant("SCHED_FIFO", True, f"priority {realtime.PRIORITY}")
        assert (policy, priority) == (os.SCHED_FIFO, realtime.PRIORITY)
    else:
        assert policy != os.SCHED_FIFO
        assert "SCHED_FIFO: " in grants["nice"].detail
    assert grants["affinity"] == Grant("affinity", True, f"core {cpu}")
    assert cores == [cpu]
    assert grants["timer slack"].granted


@pytest.mark.skipif(sys.platform != "linux", reason="takes the rights away as Linux does")
def test_without_rights_it_says_so_and_runs():
    """Another user, whose limits forbid it all."""
    drop = "import resource\n"
    drop += (
        "for name in ('RTPRIO', 'NICE', 'MEMLOCK'): resource.setrlimit(getattr(resource, 'RLIMIT_' + name), (0, 0))\n"
    )
    drop += "os.geteuid() == 0 and os.setuid(65534)"
    grants, policy = asked(before=drop, after="os.sched_getscheduler(0)", cpu=10_000)
    assert policy == os.SCHED_OTHER
    nice = grants["nice"]
    assert not nice.granted
    assert "SCHED_FIFO" in nice.detail and "ermi" in nice.detail
    assert "limit of locked memory is 0 KiB" in grants["locked memory"].detail
    assert not grants["locked memory"].granted
    assert not grants["affinity"].granted
    assert all("\n" not in grant.detail for grant in grants.values())


@pytest.mark.parametrize("system", ["linux", "darwin", "win32"])
def test_nothing_raises_on_any_system_even_if_no_call_exists(monkeypatch, system):
    monkeypatch.setattr(sys, "platform", system)
    for name in ("sched_setscheduler", "setpriority", "sched_setaffinity"):
        monkeypatch.delattr(os, name, raising=False)

    def no_library(*_):
        raise OSError("no such library")

    monkeypatch.setattr(realtime, "_libc_call", no_library)
    grants = request_realtime(cpu=0)
    assert len(grants) == 4
    assert not any(grant.granted for grant in grants)
    assert all(grant.detail and "\n" not in grant.detail for grant in grants)
    assert all(set(asdict(grant)) == {"what", "granted", "detail"} for grant in grants)


def test_a_parent_that_changes_is_gone(monkeypatch):
    gone = parent_is_gone()
    assert not gone()
    monkeypatch.setattr(os, "getppid", lambda: 1_000_000)
    assert gone() == (sys.platform != "win32")


FAVOUR = """
import json, os, subprocess, sys
from otwarp.haptics.core.realtime import favour
def how():
    return [os.sched_getscheduler(0) & 7, os.getpriority(os.PRIO_PROCESS, 0)]
before = how()
{refuse}
back = favour()
during = how()
child = subprocess.run([sys.executable, "-c", "import os; print(os.sched_getscheduler(0) & 7)"], capture_output=True)
back()
print(json.dumps([before, during, int(child.stdout), how()]))
"""
REFUSE = """
from otwarp.haptics.core import realtime
def _no():
    raise PermissionError("no")
realtime._round_robin = _no
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads back what Linux did")
@pytest.mark.parametrize("refuse", ("", REFUSE), ids=("round robin", "nice"))
def test_a_favoured_thread_goes_back_to_where_it_was(refuse):
    code = FAVOUR.format(refuse=refuse)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, during, child, after = json.loads(done.stdout)
    assert after == before and child == os.SCHED_OTHER
    # a system that allows neither leaves everything as it was
    allowed = [before, [os.SCHED_OTHER, before[1] - realtime.FAVOUR]] + ([] if refuse else [[os.SCHED_RR, before[1]]])
    assert during in allowed
    if os.geteuid() == 0 and not refuse:
        assert during != before
