"""Interrupts in the middle of a take, and the order in which a node's entities go, on a real (loopback) network."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from otwarp.errors import InputError
from otwarp.ros.ros2 import Publisher, Ros2Node, load_messages
from otwarp.ros.ros2 import node as node_module
from otwarp.ros.ros2.dds import cyclone_config
from tests.ros.ros2.setups import child, expect_soon

pytest.importorskip("cyclonedds")
m = load_messages()

INTERRUPTS = 3000
"""Signals that come while messages are taken; `DataReader.take` of cyclonedds 11.0.1 outlived 74 at most."""


@pytest.fixture
def shared_domain(domain, monkeypatch):
    """A domain that the user has configured, so that no `Domain` of the node sweeps up what is left in it."""
    config = cyclone_config({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert config is not None
    monkeypatch.setenv("CYCLONEDDS_URI", config)
    return domain


INTERRUPTED = """
import random, signal, sys, time
from otwarp.ros.ros2 import Ros2Node, load_messages

m = load_messages()
class Interrupt(BaseException): pass
def interrupt(*_): raise Interrupt
signal.signal(signal.SIGALRM, interrupt)
chance, interrupts, taken = random.Random(3), 0, 0
with Ros2Node("interrupted", int(sys.argv[1])) as node:
    out, heard = node.publisher("/a", m.Twist), node.subscribe("/a", m.Twist)
    while not out.matched: pass
    def whole():
        for _ in range(4):
            out.publish(m.Twist())
        begun = time.perf_counter()
        heard.take()
        return time.perf_counter() - begun
    # of a take that is not interrupted, so that on any machine some end before the signal and others do not
    takes = sorted(whole() for _ in range(51))[25]
    while interrupts < int(sys.argv[2]):
        for _ in range(4):
            out.publish(m.Twist())
        try:
            signal.setitimer(signal.ITIMER_REAL, chance.uniform(1e-6, max(150e-6, 2.0 * takes)))
            while True:
                taken += len(heard.take())
        except Interrupt:
            interrupts += 1
    out.publish(m.Twist(m.Vector3(7.0)))
    print(heard.take()[-1].linear.x, heard.malformed, taken > 0)
"""


def test_an_interrupt_at_any_moment_of_a_take_does_no_harm(domain):
    peer = child(INTERRUPTED, domain, INTERRUPTS)
    said, _ = peer.communicate()
    assert (peer.returncode, said.split()) == (0, ["7.0", "0", "True"])


def test_the_end_of_a_writer_is_no_message(domain):
    with Ros2Node("left", domain) as left, Ros2Node("right", domain) as right:
        out, heard = left.publisher("/a", m.Twist), right.subscribe("/a", m.Twist)
        expect_soon(lambda: out.matched and heard.matched, "a match")
        out.publish(m.Twist(m.Vector3(1.0)))
        out.close()
        expect_soon(lambda: not heard.matched, "the writer to be gone")
        assert [message.linear.x for message in heard.take()] == [1.0]
        assert heard.take() == []
        assert (heard.received, heard.malformed) == (1, 0)


def test_an_end_that_closes_leaves_others_on_its_topic(domain):
    with Ros2Node("left", domain) as node:
        out, first, second = node.publisher("/a", m.Twist), node.subscribe("/a", m.Twist), node.subscribe("/a", m.Twist)
        expect_soon(lambda: out.matched == 2, "a match")
        first.close()
        first.close()
        expect_soon(lambda: out.matched == 1, "one to leave")
        out.publish(m.Twist(m.Vector3(1.0)))
        assert [message.linear.x for message in second.take()] == [1.0]


def entities(node: Ros2Node) -> list:
    """All of a node, as a traceback may keep them."""
    ends: list[Any] = [end._writer if isinstance(end, Publisher) else end._reader for end in node._ends]
    return [*ends, *(end.topic for end in ends), node._participant]


def is_there(entity) -> bool:
    """Whether Cyclone still has it."""
    from cyclonedds.core import DDSException

    try:
        return entity.get_guid() is not None
    except DDSException:
        return False


@pytest.mark.parametrize("configured", ["domain", "shared_domain"])
def test_close_deletes_what_others_still_refer_to_from_the_leaves_to_the_root(configured, request, monkeypatch):
    gone, delete = [], node_module.delete
    monkeypatch.setattr(node_module, "delete", lambda entity: (gone.append(type(entity).__name__), delete(entity)))
    node = Ros2Node("twin", request.getfixturevalue(configured))
    node.publisher("/a", m.Twist)
    node.subscribe("/b", m.Twist)
    held = entities(node)
    assert all(map(is_there, held))
    node.close()
    assert not any(map(is_there, held))
    assert gone[:5] == ["DataWriter", "Topic", "DataReader", "Topic", "DomainParticipant"]
    assert gone[5:] == (["Domain"] if configured == "domain" else [])


@pytest.mark.parametrize("step", range(5))
def test_a_close_that_was_interrupted_can_be_called_again(step, shared_domain, monkeypatch):
    node = Ros2Node("twin", shared_domain)
    out, heard = node.publisher("/a", m.Twist), node.subscribe("/b", m.Twist)
    held, left, delete = entities(node), [step], node_module.delete

    def _interrupted(entity) -> None:
        delete(entity)
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(node_module, "delete", _interrupted)
        node.close()
    node.close()
    assert not any(map(is_there, held))
    assert out.matched == heard.matched == 0 and shared_domain not in node_module._domains


def test_a_node_may_be_closed_while_another_thread_takes(domain):
    for _ in range(10):
        node = Ros2Node("twin", domain)
        out, heard = node.publisher("/a", m.Twist), node.subscribe("/a", m.Twist)
        begun, said = threading.Event(), []

        def _take(heard=heard, out=out, begun=begun, said=said) -> None:
            try:
                while True:
                    out.publish(m.Twist())
                    heard.take()
                    begun.set()
            except InputError as error:
                said.append(str(error))

        thread = threading.Thread(target=_take)
        thread.start()
        assert begun.wait(60.0)
        node.close()
        thread.join()
        assert len(said) == 1
