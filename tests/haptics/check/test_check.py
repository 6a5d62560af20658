"""What `otwarp haptics check` finds and says; times are measured, and nothing is claimed about them."""

from __future__ import annotations

import io
import json
import re

import pytest
from rich.console import Console

from otwarp.cli.haptics.tables import check_tables, device_table, grant_table, width_table
from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.check import (
    ADVICE,
    CHECKED,
    CallCost,
    Check,
    FoundDevices,
    advised,
    chain_costs,
    find_all_devices,
    mailbox_costs,
    run_check,
    step_cost,
    system_text,
    time_calls,
    zwidth,
)
from otwarp.haptics.check.timing import (
    CURVE,
    VIRTUAL,
    Percentiles,
    TimedChain,
    check_hand,
    check_scene,
    measure_latency,
)
from otwarp.haptics.check.zwidth import Width, chain_width, limits, widths
from otwarp.haptics.core import DeviceInfo, DeviceSample
from otwarp.haptics.core.realtime import Grant
from otwarp.haptics.devices import KINDS
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import IsotropicLaw
from otwarp.teleop.operators.servo import compile_laws
from tests.haptics.found_doubles import DOUBLES

INFO = DeviceInfo(name="double", kind="virtual", force=3.3, continuous_force=0.88)


def printed(*tables) -> str:
    console = Console(width=200, file=io.StringIO())
    for table in tables:
        console.print(table)
    return console.file.getvalue()  # type: ignore[attr-defined]


class TestDevices:
    def test_every_way_of_being_there_and_not(self):
        found = {one.kind: one for one in find_all_devices(DOUBLES)}
        assert found["software"] == FoundDevices("software", True, (), "")
        assert found["there"].found == ("there:0001 first", "there:0002 second")
        assert found["nothing"] == FoundDevices("nothing", False, (), "")
        assert "needs the package websockets" in found["absent"].trouble
        assert found["broken"].trouble == "OSError: libHD.so: wrong ELF class"
        assert "otwarp_test_no_such_module" in found["gone"].trouble

    def test_the_table_says_each(self):
        text = printed(device_table(find_all_devices(DOUBLES)))
        for words in ("always there", "there:0002 second", "none", "needs the package", "pip install 'otwarp[haply]'"):
            assert words in text

    def test_all_real_kinds_are_asked(self):
        told: list[str] = []
        found = find_all_devices(progress=told.append)
        assert [one.kind for one in found] == list(KINDS)
        assert len(told) == len(KINDS)


class TestGrants:
    def test_refused_ones_come_with_advice(self):
        grants = (Grant("SCHED_FIFO", True, "priority 80"), Grant("locked memory", False, "the limit is 64 KiB"))
        first, second = advised(grants)
        assert first.advice == "" and "memlock" in second.advice
        assert "the limit is 64 KiB" in printed(grant_table([first, second]))

    def test_a_nice_value_is_half_a_grant(self):
        assert "rtprio" in advised((Grant("nice", True, "-20 (SCHED_FIFO: not permitted)"),))[0].advice

    def test_everything_a_servo_asks_for_has_advice(self):
        """What `platform.request_realtime` may name, on any system."""
        assert set(ADVICE) == {
            "SCHED_FIFO", "nice", "timer slack", "locked memory", "affinity", "priority class", "timer period"
        }  # fmt: skip


class TestLatency:
    def test_the_chain_tells_its_times_once(self, tmp_path):
        file = tmp_path / "times.json"
        chain = TimedChain(str(file), 40, check_hand(), INFO)
        plain = Chain(check_hand(), local_model(check_hand(), {i: (IsotropicLaw(CURVE),) for i in range(3)}))
        for one in (chain, plain):
            one.arm()
        for n in range(150):
            sample, scene = DeviceSample(1e-3 * n, (1e-5 * n, 0.0, 0.0), fresh=n % 2 == 0), check_scene(n // 8 + 1, 0.0)
            assert chain.step(sample, scene) == plain.step(sample, scene)
        found = json.loads(file.read_text())
        # the first hundred do not count; a state every eighth cycle
        assert (found["cycles"], found["fresh"]) == (40, 20)
        assert len(found["sample"]) == 40 and len(found["state"]) == 5

    def test_the_servo_process_is_measured(self):
        found = measure_latency(0.2)
        assert (found.device, found.cycles, found.armed, found.fresh) == (VIRTUAL, 200, True, 1.0)
        assert 0.0 < found.sample.p50 <= found.sample.max
        assert 0.0 < found.state.p50 <= found.state.max

    def test_a_real_device_is_not_armed(self, tmp_path):
        """Only a virtual device is: a replay stands for a real one."""
        file = tmp_path / "still.csv"
        file.write_text("time,x,y,z\n0,0,0,0\n1000,0.01,0,0\n")
        assert not measure_latency(0.1, device=f"replay:{file}").armed

    @pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), 1e9])
    def test_bad_lengths_are_refused(self, seconds):
        with pytest.raises(InputError, match="seconds"):
            measure_latency(seconds)

    def test_an_unknown_device_is_one_line(self):
        with pytest.raises(InputError, match="unknown kind") as caught:
            run_check(0.05, device="spoon", width=False, steps=1)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("bad", "line"),
        [
            ({"seconds": -1.0}, "seconds = -1.0: must be from 0.05 to 3600 s"),
            ({"seconds": 0.5, "rate": 1.0}, "seconds = 0.5: must be from 1 to 3600 s"),
            ({"rate": 1e6}, "rate = 1000000.0: must be from 1 to 20000 Hz"),
            ({"rate": float("nan")}, "rate = nan: must be from 1 to 20000 Hz"),
        ],
    )
    def test_bad_numbers_are_told_before_anything_is_looked_for(self, bad, line):
        told: list[str] = []
        with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
            run_check(**bad, width=False, progress=told.append)
        assert not told

    def test_a_device_that_is_not_there_is_told_before_anything_else_is_measured(self):
        told: list[str] = []
        with pytest.raises(InputError, match=r"absent\.csv"):
            run_check(0.05, device="replay:absent.csv", width=False, progress=told.append)
        assert told == ["latency in the servo process, replay:absent.csv"]


class TestCosts:
    def test_every_call_is_timed(self):
        seen: list[int] = []
        assert time_calls(seen.append, 5).max >= 0.0
        assert seen == [0, 1, 2, 3, 4]
        with pytest.raises(InputError, match="count"):
            time_calls(seen.append, 0)

    def test_the_timed_chain_pushes(self):
        """What is timed is a chain that is armed and feels something, not one that refuses its input."""
        config = check_hand()
        chain = Chain(config, local_model(config, {i: (IsotropicLaw(CURVE),) for i in config.traps}))
        step_cost(chain, steps=700)
        assert chain.complaint == ""
        assert max(abs(f) for f in chain.asked) > 0.01

    def test_a_compiled_law_is_measured_beside_the_one_in_python(self):
        """And it is that of a session, told by its name; the costs themselves are for the reader."""
        code, said = compile_laws(CHECKED)
        costs = chain_costs(20, code)
        assert said == "compiled" and len(costs) == 7
        assert sum(cost.what.endswith(", compiled") for cost in costs) == 3

    def test_all_of_them_have_a_name_and_a_time(self):
        costs = [*chain_costs(20), *mailbox_costs(20)]
        assert len({cost.what for cost in costs}) == len(costs) == 8
        assert all(0.0 < cost.time.p50 <= cost.time.max for cost in costs)


class TestWidth:
    def test_rows_have_theory_and_paper_beside_them(self, monkeypatch):
        monkeypatch.setattr(zwidth, "chain_width", lambda chain, *, wall=False, high: high)
        monkeypatch.setattr(zwidth, "paper_width", lambda *, rate, delay=0.0: 1e-3 * rate)
        found = widths()
        assert [one.reference for one in found] == [pytest.approx(400.0), None, None, 10.3, 1.4]
        assert [one.open_ended for one in found] == [False, True, True, False, False]
        text = printed(width_table(found))
        assert "≥ 20000" in text and "2b/T" in text

    def test_the_first_row_is_what_z_width_says(self, monkeypatch):
        monkeypatch.setattr(zwidth, "paper_width", lambda *, rate, delay=0.0: 1.0)
        monkeypatch.setattr(zwidth, "chain_width", lambda chain, **how: chain_width(chain, **(how | {"high": 300.0})))
        assert widths()[0].found == 300.0

    def test_limits_are_the_presets(self):
        found = {one.what: one.value for one in limits()}
        assert "400 N/m" in found["stiffness without passivity control"]
        assert "10.3 N/m" in found["stiffness behind a filter of the force"]
        assert found["force"] == "3.3 N"


def test_all_that_is_found_goes_through_json_and_tables():
    told: list[str] = []
    found = run_check(0.05, width=False, steps=10, progress=told.append)
    data = json.loads(json.dumps(found.json(), allow_nan=False))
    assert data["latency"]["cycles"] == 50 and data["jitter"][1]["busy"] == 2
    text = printed(*check_tables(found))
    for title in ("Devices", "What the system gives", "Loop jitter", "Latency", "Cost of one call", "What is limited"):
        assert title in text
    assert system_text() in found.system
    assert any("jitter" in line for line in told)


def test_without_a_latency_its_table_is_left_out():
    spread = Percentiles(1e-6, 1e-6, 1e-6, 1e-6)
    found = Check(
        system="here", devices=[], grants=[], jitter=[], latency=None, costs=[CallCost("nothing", spread)],
        widths=[Width("loop", 1.0, False, None, "")], limits=[], trouble=["latency: no servo"],
    )  # fmt: skip
    text = printed(*check_tables(found))
    assert "Latency" not in text and "Z-width" in text
