"""Both backends of `open_node` in one process that can import rospy; run by this Python as `rospy_backend.py PATH`.

PATH holds rospy and is searched last, so that everything else is this Python's own.
"""

from __future__ import annotations

import sys
import time

sys.path.append(sys.argv[1])

from otwarp.errors import InputError
from otwarp.ros.ros1.interface import open_node
from otwarp.ros.ros1.messages import message_type
from otwarp.ros.ros1.rospy_node import RospyNode
from tests.ros.ros1.golden import MD5, bytes_of, message_of


def wait_for(condition):
    deadline = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < deadline, "waited 30 s"
        time.sleep(0.005)


def main():
    theirs, ours = open_node("/by/rospy"), open_node("own", backend="own")
    assert isinstance(theirs, RospyNode) and theirs.name == "/by_rospy" and theirs.alive
    for n, name in enumerate(MD5):
        for sender, receiver, topic in ((theirs, ours, f"/a{n}"), (ours, theirs, f"/b{n}")):
            got = []
            out = sender.publisher(topic, name)
            heard, called = receiver.subscribe(topic, name), receiver.subscribe(topic, name, got.append)
            links = (out, heard, called)  # of a node to a topic there is one, however many listen
            wait_for(lambda links=links: [one.connections for one in links] == [1, 1, 1])
            out.publish(message_of(name))
            wait_for(lambda heard=heard, got=got: heard.received == 1 and len(got) == 1)
            # rospy counts the sequence number of a header only in messages that it knows to have one: not in bytes
            for message in (heard.take(), got[0]):
                assert message_type(name).encode(message) == bytes_of(name), (name, message)
            assert heard.take() is None and called.received == 1
    # a second node shares the process's; another master cannot be had
    second = open_node("second")
    assert second.name == "/by_rospy"
    try:
        open_node("third", master_uri=sys.argv[2].replace("127.0.0.1", "localhost"))
    except InputError as error:
        assert "one node per process" in str(error), error
    else:
        raise AssertionError("a second master was accepted")
    for node in (second, theirs, ours):
        node.close()
    assert not theirs.alive and not second.alive
    print("exchanged", len(MD5), "types both ways")


main()
