"""The same node by `rospy`, for machines where ROS 1 is installed.

`rospy` knows one node per process and cannot start it twice: all `RospyNode`s of a process share it under the first
one's name, and `close` takes back the topics, not the node. It does not register again with a master that restarted.
Messages travel as bytes, so that no generated Python package of a message type is needed.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

from otwarp.errors import InputError
from otwarp.ros.ros1 import names
from otwarp.ros.ros1.interface import Newest
from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import MessageType, message_type
from otwarp.ros.ros1.node import check_master
from otwarp.ros.ros1.publisher import QUEUE
from otwarp.ros.ros1.wire import Malformed

FLUSH = 0.05
"""Seconds before topics are taken back: rospy does not tell whether its queues are empty."""

_starting = threading.Lock()
_master: str | None = None
"""URI of the master that the process's node is registered with."""


def _start(rospy: Any, name: str, master: str, host: str | None) -> None:
    """Start the process's node, or see that it is on this master."""
    global _master
    with _starting:
        if _master is None:
            os.environ[names.MASTER] = master
            if host is not None:
                os.environ["ROS_HOSTNAME"] = host
            # rospy's own names have no namespace in them
            rospy.init_node(name.strip("/").replace("/", "_"), disable_signals=True, disable_rostime=True)
            _master = master
        elif _master != master:
            raise InputError(f"{names.MASTER} is {master!r}; allowed: {_master}, rospy has one node per process")


def _carrier(rospy: Any, kind: MessageType) -> type[Any]:
    """A message class of `rospy` that is the bytes of a type."""
    fields = {"_type": kind.name, "_md5sum": kind.md5, "_full_text": kind.definition, "_has_header": False}
    return type(kind.name.replace("/", "_"), (rospy.AnyMsg,), fields)


class RospyPublisher:
    """See `RosPublisher`."""

    def __init__(self, rospy: Any, topic: str, kind: MessageType, latch: bool, queue: int) -> None:
        self.topic, self.type = topic, kind
        self._class = _carrier(rospy, kind)
        self._publisher = rospy.Publisher(topic, self._class, latch=latch, queue_size=queue, tcp_nodelay=True)
        self._closed = False

    @property
    def connections(self) -> int:
        """See `RosPublisher`."""
        return self._publisher.get_num_connections()

    def publish(self, message: Any) -> None:
        """See `RosPublisher`."""
        carrier = self._class()
        carrier._buff = self.type.encode(message)
        if not self._closed:
            self._publisher.publish(carrier)

    def close(self) -> None:
        """See `RosPublisher`."""
        closed, self._closed = self._closed, True
        if not closed:
            self._publisher.unregister()


class RospySubscription(Newest):
    """See `RosSubscription`; a message that cannot be decoded is dropped and noted, its connection stays."""

    def __init__(
        self, rospy: Any, topic: str, kind: MessageType, callback: Callable[[Any], None] | None, log: EventLog
    ) -> None:
        super().__init__()
        self.topic, self.type, self._callback, self._log = topic, kind, callback, log
        self._closed = False
        self._subscriber = rospy.Subscriber(
            topic, _carrier(rospy, kind), self._came, queue_size=None if callback else 1, tcp_nodelay=True
        )

    @property
    def connections(self) -> int:
        """See `RosSubscription`."""
        return self._subscriber.get_num_connections()

    def _came(self, carrier: Any) -> None:
        try:
            message = self.type.decode(carrier._buff)
        except Malformed as error:
            self._log.note("malformed", f"{self.topic}: {error}")
            return
        self.put(message)
        if self._callback is not None and not self._closed:
            try:
                self._callback(message)
            except Exception as error:  # as with our own client
                self._log.note("callback", f"{self.topic}: {type(error).__name__}: {error}")

    def close(self) -> None:
        """See `RosSubscription`."""
        closed, self._closed = self._closed, True
        if not closed:
            self._subscriber.unregister()


class RospyNode:
    """See `RosNode` and the module.

    Raises:
        InputError: A bad name or URI, a second master in one process, or a master that does not answer.
    """

    def __init__(self, name: str, master_uri: str | None = None, host: str | None = None) -> None:
        import rospy  # type: ignore[import-not-found]

        name, master = names.global_name("node", name), names.master_uri(master_uri)
        # without this rospy would wait for a master for ever
        check_master(master, name)
        _start(rospy, name, master, host)
        self._rospy = rospy
        self.name: str = rospy.get_name()
        self.log = EventLog()
        self._topics: list[RospyPublisher | RospySubscription] = []
        self._closed = False

    @property
    def alive(self) -> bool:
        """See `RosNode`."""
        return not self._closed and not self._rospy.is_shutdown()

    def publisher(self, topic: str, type_name: str, latch: bool = False, queue: int = QUEUE) -> RospyPublisher:
        """See `RosNode`."""
        topic = names.global_name("topic", topic)
        self._topics.append(made := RospyPublisher(self._rospy, topic, message_type(type_name), latch, queue))
        return made

    def subscribe(self, topic: str, type_name: str, callback: Callable[[Any], None] | None = None) -> RospySubscription:
        """See `RosNode`."""
        topic, kind = names.global_name("topic", topic), message_type(type_name)
        self._topics.append(made := RospySubscription(self._rospy, topic, kind, callback, self.log))
        return made

    def close(self) -> None:
        """See `RosNode`; what is queued has `FLUSH` to leave."""
        if not self._closed and any(isinstance(topic, RospyPublisher) and topic.connections for topic in self._topics):
            time.sleep(FLUSH)
        self._closed = True
        for topic in self._topics:
            topic.close()
        self._topics.clear()
