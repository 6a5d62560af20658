from __future__ import annotations

import signal
import subprocess
import sys
import time
from multiprocessing.shared_memory import SharedMemory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import STATES, SceneFrame, ServoFrame, SphereFrame, TrapFrame, shared_memory
from otwarp.haptics.core.shared_memory import RETRIES, SEQUENCE_AT, Mailbox, RecordLayout
from otwarp.haptics.servo.link import HandLayout, SceneLayout, SceneReader

EVENTUALLY = 60.0
"""Seconds after which something that must happen is called missing; generous, as machines may be busy."""

real = st.floats(allow_nan=False)
vec3 = st.tuples(real, real, real)
index = st.integers(-(2**63), 2**63 - 1)
scenes = st.builds(
    SceneFrame,
    beat=st.integers(0, 2**64 - 1),
    time=real,
    spheres=st.lists(st.builds(SphereFrame, vec3, index), max_size=5).map(tuple),
    traps=st.lists(st.builds(TrapFrame, index, vec3, real), max_size=3).map(tuple),
    contact_force=real,
)
hands = st.builds(
    ServoFrame,
    tick=st.integers(0, 2**64 - 1),
    time=real,
    position=vec3,
    force=vec3,
    traps=st.lists(st.tuples(index, vec3), max_size=3).map(tuple),
    state=st.sampled_from(STATES),
    energy=real,
    buttons=st.integers(0, 2**32),
)


def scene(beat: int, value: float = 0.5) -> SceneFrame:
    return SceneFrame(
        beat, value, (SphereFrame((value, value, value), 3),), (TrapFrame(1, (value,) * 3, value),), value
    )


@pytest.fixture
def pair():
    layout = SceneLayout(5, 3)
    with Mailbox.create(layout) as writer, Mailbox.attach(SceneLayout(5, 3), writer.name) as reader:
        yield writer, reader


@given(sent=st.lists(scenes, min_size=1, max_size=3))
@settings(max_examples=60, deadline=None)
def test_scenes_arrive_bit_for_bit_and_once(sent):
    with Mailbox.create(SceneLayout(5, 3)) as writer, Mailbox.attach(SceneLayout(5, 3), writer.name) as reader:
        assert reader.read() is None
        for value in sent:
            writer.write(value)
            assert reader.read() == value
            assert reader.read() is None


@given(sent=hands)
@settings(max_examples=60, deadline=None)
def test_hands_arrive_bit_for_bit(sent):
    with Mailbox.create(HandLayout(3)) as writer, Mailbox.attach(HandLayout(3), writer.name) as reader:
        writer.write(sent)
        assert reader.read() == sent


def test_only_the_latest_is_kept(pair):
    writer, reader = pair
    for beat in range(1, 6):
        writer.write(scene(beat))
    assert reader.read() == scene(5)


@pytest.mark.parametrize("moment", ["odd", "changed payload", "changed sequence"])
def test_a_write_that_never_ends_is_no_fresh_state(pair, moment):
    """The writer is killed in mid-write, or the machine shows its stores in another order."""
    writer, reader = pair
    writer.write(scene(1))
    assert reader.read() == scene(1)
    writer.write(scene(2))
    if moment == "odd":
        writer._sequence[0] += 1
    elif moment == "changed payload":
        writer._payload[8] ^= 0x10
    else:
        writer._sequence[0] += 2  # an even number that this payload was not written under
    assert reader.read() is None
    assert reader.torn == 1
    with Mailbox.attach(SceneLayout(5, 3), writer.name) as second:  # a new writer heals it
        second.write(scene(3))
        assert second._sequence[0] % 2 == 0
        assert reader.read() == scene(3)


def test_reads_that_are_spoiled_are_tried_a_bounded_number_of_times(pair):
    writer, reader = pair
    writer.write(scene(1))

    class Busy:
        """A sequence number under a writer that never rests."""

        reads = 0

        def __getitem__(self, _):
            self.reads += 1
            return 2 * self.reads

    kept, reader._sequence = reader._sequence, Busy()
    assert reader.read() is None
    assert reader._sequence.reads == 2 * RETRIES
    reader._sequence = kept
    assert reader.read() == scene(1)


WRITER = """
import sys
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.link import SceneLayout
from otwarp.haptics.core import SceneFrame, SphereFrame
box = Mailbox.attach(SceneLayout(64, 0), sys.argv[1])
states = [SceneFrame(b, b, tuple(SphereFrame((b, b, b), b) for _ in range(64)), (), b) for b in range(1, 8)]
print("ready", flush=True)
while True:
    for state in states * 100:
        box.write(state)
"""


def test_no_torn_read_beside_a_writer_that_never_rests():
    """States all of whose numbers are equal: a mixture of two would show. Ends when enough distinct reads were made."""
    with Mailbox.create(SceneLayout(64, 0)) as box:
        child = subprocess.Popen([sys.executable, "-c", WRITER, box.name], stdout=subprocess.PIPE)
        try:
            assert child.stdout.readline() == b"ready\n"
            good, end = 0, time.monotonic() + EVENTUALLY
            while good < 500 and time.monotonic() < end:
                state = box.read()
                if state is not None:
                    good += 1
                    assert {c for s in state.spheres for c in (*s.position, s.body)} == {state.beat} == {state.time}
            assert good == 500
        finally:
            child.kill()
            child.wait()
            child.stdout.close()


def test_attaching_and_leaving_does_not_remove_the_memory_of_others():
    """Python 3.11 would: the resource tracker of the one that leaves removes all that it registered."""
    with Mailbox.create(SceneLayout(5, 3)) as box:
        code = "from otwarp.haptics.core.shared_memory import *\nfrom otwarp.haptics.core import *\n"
        code += "from otwarp.haptics.servo.link import *\n"
        code += f"box = Mailbox.attach(SceneLayout(5, 3), {box.name!r}); box.write({scene(7)!r})"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        assert box.read() == scene(7)
        Mailbox.attach(SceneLayout(5, 3), box.name).close()


OWNER = """
import time
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.link import HandLayout
box = Mailbox.create(HandLayout(2))
print(box.name, flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes a mapping with its last handle")
def test_the_memory_of_a_killed_owner_goes_away_and_stays_mapped_where_it_is_used():
    child = subprocess.Popen([sys.executable, "-c", OWNER], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    name = child.stdout.readline().decode().strip()
    with Mailbox.attach(HandLayout(2), name) as box:
        child.send_signal(signal.SIGKILL)
        child.wait()
        child.stdout.close()
        end = time.monotonic() + EVENTUALLY
        while time.monotonic() < end:
            try:
                Mailbox.attach(HandLayout(2), name).close()
            except InputError:
                break
            time.sleep(0.02)
        else:
            pytest.fail(f"{name} is still there")
        assert box.read() is None
        box.write(ServoFrame(1, 0.0, (0.0,) * 3, (0.0,) * 3, (), "armed", 0.0))
        assert box.read().tick == 1


def test_closing_twice_is_harmless():
    box = Mailbox.create(HandLayout(1))
    for _ in range(2):
        box.close()
        with pytest.raises(InputError, match=box.name):
            Mailbox.attach(HandLayout(1), box.name)


def test_other_sizes_kinds_versions_and_foreign_memory_are_refused(monkeypatch):
    with Mailbox.create(SceneLayout(5, 3)) as box:
        for layout in (SceneLayout(6, 3), SceneLayout(5, 2), HandLayout(3)):
            with pytest.raises(InputError, match=box.name) as error:
                Mailbox.attach(layout, box.name)
            assert "\n" not in str(error.value)
        monkeypatch.setattr(shared_memory, "VERSION", 2)
        with pytest.raises(InputError, match="must hold"):
            Mailbox.attach(SceneLayout(5, 3), box.name)
    with pytest.raises(InputError, match="is its creator running"):
        Mailbox.attach(SceneLayout(5, 3), "otwarp_no_such_box")
    small = SharedMemory(create=True, size=16)
    try:
        with pytest.raises(InputError):
            Mailbox.attach(SceneLayout(5, 3), small.name)
    finally:
        small.close()
        small.unlink()


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (SceneFrame(1, 0.0, (SphereFrame((0.0,) * 3, 0),) * 6, ()), "spheres = 6.*at most 5"),
        (SceneFrame(1, 0.0, (), (TrapFrame(0, (0.0,) * 3, 1.0),) * 4), "traps = 4.*at most 3"),
        (SceneFrame(-1, 0.0, (), ()), "scene state"),
        (SceneFrame(1, "soon", (), ()), "scene state"),
    ],
)
def test_what_does_not_fit_is_one_clear_line_and_leaves_the_last_state(pair, value, says):
    writer, reader = pair
    writer.write(scene(1))
    with pytest.raises(InputError, match=says) as error:
        writer.write(value)
    assert "\n" not in str(error.value)
    assert reader.read() == scene(1)


def test_bad_hands_records_and_capacities():
    with Mailbox.create(HandLayout(1)) as box:
        good = ServoFrame(1, 0.0, (0.0,) * 3, (0.0,) * 3, (), "armed", 0.0)
        for bad, says in (("asleep", "must be one of"), (None, "state = None")):
            with pytest.raises(InputError, match=says):
                box.write(ServoFrame(1, 0.0, good.position, good.force, (), bad, 0.0))
        with pytest.raises(InputError, match="traps of a hand = 2"):
            box.write(ServoFrame(1, 0.0, good.position, good.force, ((0, (0.0,) * 3),) * 2, "armed", 0.0))
        with pytest.raises(InputError, match="hand state"):
            box.write(ServoFrame(-1, 0.0, good.position, good.force, (), "armed", 0.0))
    with Mailbox.create(RecordLayout(b"note", "Qd8s")) as box:
        box.write((3, 0.5, b"hello"))
        assert box.read() == (3, 0.5, b"hello\0\0\0")
        with pytest.raises(InputError, match="note message"):
            box.write((3, 0.5))
    for bad in (-1, 1.5, 10**6):
        with pytest.raises(InputError, match="whole number"):
            SceneLayout(bad, 1)


@pytest.mark.parametrize("place", ["time", "contact", "sphere", "trap", "power"])
@pytest.mark.parametrize("poison", [float("nan"), float("inf"), float("-inf")])
def test_states_that_are_not_finite_never_reach_the_chains(pair, place, poison):
    writer, box = pair
    reader = SceneReader(box)
    assert reader.latest().beat == 0
    writer.write(scene(1))
    assert reader.latest() == scene(1)
    at = {key: poison if key == place else 0.5 for key in ("time", "contact", "sphere", "trap", "power")}
    sphere, trap = (0.5, at["sphere"], 0.5), (0.5, 0.5, at["trap"])
    bad = SceneFrame(2, at["time"], (SphereFrame(sphere, 3),), (TrapFrame(1, trap, at["power"]),), at["contact"])
    writer.write(bad)
    assert reader.latest() == scene(1)
    assert reader.refused == 1
    writer.write(scene(3))
    assert reader.latest() == scene(3)


def test_the_sequence_has_a_cache_line_of_its_own():
    assert shared_memory.HEADER.size <= SEQUENCE_AT
    assert shared_memory.PAYLOAD_AT - SEQUENCE_AT >= 64
