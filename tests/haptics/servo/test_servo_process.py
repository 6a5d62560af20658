"""The servo as a process: nothing here asserts a wall-clock figure, only what must come in the end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE, ENDING, GAINS, ZERO, SceneFrame, SphereFrame, actions_of, cycles_of
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices.mouse import POINTER
from otwarp.haptics.servo.link import Cycles, HandLayout, HandSetup, StatusLayout
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.setups import chain_for, hand_config, scene_at
from tests.haptics.spring import SpringChain, TellingChain

EVENTUALLY = 60.0
"""Seconds after which something that must happen is called missing; generous, as machines may be busy."""
ROOT = Path(__file__).resolve().parents[3]
HOLD = "virtual:hold,at=0.01/0/0"


def scene(beat: int) -> SceneFrame:
    return SceneFrame(beat, 0.001 * beat, (SphereFrame((0.0, 0.0, 0.0), 0),), ())


def until(condition, each=lambda: None):
    end = time.monotonic() + EVENTUALLY
    while not condition():
        assert time.monotonic() < end, "did not happen"
        each()
        time.sleep(0.002)


def publishing(servo: ServoProcess, arm: bool = True, scene=scene):
    """Publishes the next state at each call, and keeps the hands armed: a busy machine may let the watchdog act."""
    beat = 0

    def publish():
        nonlocal beat
        beat += 1
        servo.publish(scene(beat))
        hand = servo.hand(0)
        if arm and hand is not None and hand.state == "disarmed":
            servo.arm()

    return publish


def test_it_feels_a_spring_stops_with_zero_force_and_loads_nothing_heavy(tmp_path):
    import numpy  # noqa: F401 - loaded here, and still not there

    told = tmp_path / "modules"
    with ServoProcess([HandSetup(HOLD, partial(TellingChain, str(told)))], spheres=1, traps=1) as servo:
        publish = publishing(servo)
        until(lambda: servo.hand(0) is not None and servo.hand(0).state == "armed", publish)
        until(told.exists, publish)
        hand = servo.hand(0)
        # the grip of 300 N/m gives way to the spring of 100 N/m; how far depends on when it is asked
        assert -1.0 - 1e-9 <= hand.force[0] < 0.0
        assert hand.traps == ((0, tuple(1e3 * x for x in hand.position)),)
        ticks = servo.status().tick
        until(lambda: servo.status().tick > ticks + 50, publish)
    loaded = set(told.read_text().split())
    assert {"otwarp.haptics.servo.servo", "otwarp.haptics.devices.virtual"} <= loaded
    assert not {m.split(".")[0] for m in loaded} & {"numpy", "warp", "pxr", "scipy", "pytest", "multiprocessing.pool"}
    assert servo.hand(0).force == ZERO
    assert servo.hand(0).state == "disarmed"
    assert servo.status().state == "stopped"
    assert not servo.alive
    servo.stop()
    for late in (servo.arm, servo.heartbeat, lambda: servo.publish(scene(1)), servo.start):
        with pytest.raises(InputError, match="stop"):
            late()


def test_a_simulation_that_stops_publishing_disarms_the_hand():
    with ServoProcess([HandSetup(HOLD, SpringChain)], spheres=1, traps=1) as servo:
        publish = publishing(servo)
        until(lambda: servo.hand(0) is not None and servo.hand(0).force[0] < 0.0, publish)
        until(lambda: servo.hand(0).state == "disarmed" and servo.hand(0).force == ZERO, servo.heartbeat)
        assert servo.status().state == "running"


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_a_killed_parent_leaves_zero_force_and_no_process():
    parent = subprocess.Popen([sys.executable, "-m", "tests.haptics.parent"], stdout=subprocess.PIPE, cwd=ROOT)
    names = json.loads(parent.stdout.readline())
    with (
        Mailbox.attach(HandLayout(1), names["hands"][0]) as hands,
        Mailbox.attach(StatusLayout(1), names["status"]) as reports,
    ):
        felt = []

        def feels():
            felt.extend(h for h in [hands.read()] if h is not None)
            return bool(felt) and felt[-1].force[0] < 0.0

        until(feels)
        parent.send_signal(signal.SIGKILL)
        # the servo has the same stdout: its end is the end of the pipe
        parent.communicate(timeout=EVENTUALLY)
        last = hands.read()
        assert (last.force, last.state) == (ZERO, "disarmed")
        assert last.tick > felt[-1].tick
        assert reports.read().state == "stopped"


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals of POSIX")
@pytest.mark.parametrize("ending", ["SIGTERM", "SIGHUP", "SIGQUIT"])
def test_a_terminated_servo_lets_go_in_order_and_its_parent_sees_it(ending):
    """Also by a terminal that is closed, or by Ctrl-\\: both reach the servo as well as its parent."""
    with ServoProcess([HandSetup(HOLD, SpringChain)], spheres=1, traps=1) as servo:
        publish = publishing(servo)
        until(lambda: servo.hand(0) is not None and servo.hand(0).force[0] < 0.0, publish)
        os.kill(servo.pid, signal.SIGINT)  # Ctrl-C in the parent's terminal reaches both; the servo waits for its order
        os.kill(servo.pid, getattr(signal, ending))
        until(lambda: not servo.alive, publish)
        assert servo.status().state == "stopped"
        assert servo.hand(0).force == ZERO


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals of POSIX")
def test_a_session_that_is_suspended_does_not_suspend_the_servo_with_its_force():
    """Ctrl-Z reaches both: the parent stands still, and the servo has to notice."""
    with ServoProcess([HandSetup(HOLD, SpringChain)], spheres=1, traps=1) as servo:
        publish = publishing(servo)
        until(lambda: servo.hand(0) is not None and servo.hand(0).force[0] < 0.0, publish)
        os.kill(servo.pid, signal.SIGTSTP)
        until(lambda: servo.hand(0).state == "disarmed" and servo.hand(0).force == ZERO)
        assert servo.alive


def test_a_pointer_moves_a_mouse():
    with Mailbox.create(POINTER) as pointer:
        hand = HandSetup("mouse", SpringChain, pointer.name)
        with ServoProcess([hand, HandSetup(HOLD, SpringChain)], spheres=1, traps=2) as servo:
            publish = publishing(servo)

            def page():
                pointer.write((0.03, 0.0, -0.01, 1))
                publish()

            until(lambda: servo.hand(0) is not None and servo.hand(0).position == (0.03, 0.0, -0.01), page)
            until(lambda: servo.hand(0).buttons == 1, page)
            assert servo.hand(1).position != servo.hand(0).position


@pytest.mark.parametrize(
    ("devices", "says"),
    [
        (["replay:/no/such/take.csv"], "/no/such/take.csv"),
        ([HOLD, "replay:/no/such/take.csv"], "/no/such/take.csv"),
        (["virtual:square"], "script 'square' must be one of"),
        (["teapot"], "unknown kind 'teapot'"),
    ],
)
def test_a_device_that_is_not_there_is_one_clear_line(devices, says):
    with (
        pytest.raises(InputError, match=says) as error,
        ServoProcess([HandSetup(d, SpringChain) for d in devices], spheres=1, traps=1),
    ):
        pass
    assert "\n" not in str(error.value)


def test_arguments_out_of_range_are_refused(monkeypatch):
    hand = HandSetup(HOLD, SpringChain)
    for bad in ({"rate": 1e6}, {"spin": -1.0}, {"spheres": -1}, {"traps": 10**9}):
        with pytest.raises(InputError, match=next(iter(bad))):
            ServoProcess([hand], **({"spheres": 1, "traps": 1} | bad))
    local = type("Local", (SpringChain,), {"__module__": "__main__"})
    monkeypatch.setattr(sys.modules["__main__"], "Local", local, raising=False)
    with pytest.raises(InputError, match="not of a script"):
        ServoProcess([HandSetup(HOLD, local)], spheres=1, traps=1)
    with pytest.raises(InputError, match="1 to 2"):
        ServoProcess([], spheres=1, traps=1)
    servo = ServoProcess([hand], spheres=1, traps=1)
    with pytest.raises(InputError, match="hand = 1: must be from 0 to 0"):
        servo.arm(1)
    servo.stop()


def test_gains_and_recordings_pass_between_the_processes():
    config = hand_config()
    with ServoProcess([HandSetup(HOLD, partial(chain_for, config))], spheres=1, traps=1) as servo:
        publish = publishing(servo, scene=lambda beat: scene_at(beat, 0.001 * beat))
        until(lambda: servo.hand(0) is not None and servo.hand(0).state == "armed", publish)
        assert servo.drain(0) == Cycles()
        records, lost = b"", 0

        def fetch():
            nonlocal records, lost
            publish()
            cycles = servo.drain(0)
            records, lost = records + cycles.records, lost + cycles.lost

        servo.record(True)
        until(lambda: len(records) > 50 * CYCLE.size, fetch)
        servo.set_gains(0, force_gain=0.2)
        servo.set_gains(0, motion_gain=30.0)
        until(lambda: cycles_of(records)[-1].motion_gain == 30.0, fetch)
        first = servo.drain(0).start
        servo.publish(scene_at(10**6, 1.0))
        servo.record(False)
        assert [state.beat for state in servo.drain(0).scenes] == [10**6]
        servo.publish(scene_at(10**6 + 1, 1.0))
        assert servo.drain(0).scenes == ()
        until(lambda: not servo.drain(0).records, publish)
        servo.publish(scene_at(10**6 + 2, 1.0))
        servo.record(True)
        servo.publish(scene_at(10**6 + 3, 1.0))
        later: list[Cycles] = []
        until(lambda: later.append(servo.drain(0)) or later[-1].start is not None, servo.heartbeat)
        assert [state.beat for state in later[-1].scenes] == [10**6 + 2, 10**6 + 3]
        for bad in ((2, 1.0, 1.0), (0, -1.0, None), (0, None, "strong")):
            with pytest.raises(InputError):
                servo.set_gains(*bad)
    cycles, last = cycles_of(records), servo.drain(0)
    assert lost == 0
    assert [c.tick for c in cycles] == list(range(first.tick, first.tick + len(cycles)))
    assert cycles[-1].force_gain == 0.2
    assert sum(GAINS in actions_of(c.actions) for c in cycles) in (1, 2)  # a later order may overtake
    assert last.start.recording == 2 > first.recording
    assert any(ENDING in actions_of(c.actions) for c in cycles_of(last.records))
    assert servo.drain(0).records == b""
    assert json.loads(first.text)["chain"]["safety"]
