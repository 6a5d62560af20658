"""What a ROS 1 node can do, whoever does it: our own client, or `rospy` where it is installed.

Messages are those of `otwarp.ros.ros1.messages` in both cases, so that nobody else has to know which one runs.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Literal, Protocol

from otwarp.errors import InputError
from otwarp.ros.ros1.log import EventLog

Backend = Literal["auto", "own", "rospy"]
BACKENDS = ("auto", "own", "rospy")


class RosPublisher(Protocol):
    """A topic that is published."""

    @property
    def connections(self) -> int:
        """How many subscribers are connected."""
        ...

    def publish(self, message: Any) -> None:
        """Hand a message to all subscribers without waiting for them; see `node.Publisher`."""
        ...

    def close(self) -> None:
        """Take the topic back."""
        ...


class RosSubscription(Protocol):
    """A topic that is listened to."""

    @property
    def connections(self) -> int:
        """How many publishers are connected."""
        ...

    @property
    def received(self) -> int:
        """Messages that came."""
        ...

    def latest(self) -> tuple[int, Any] | None:
        """(how many messages had come with it, the newest message), or None before the first."""
        ...

    def take(self) -> Any | None:
        """The newest message if it was not taken yet, else None."""
        ...

    def close(self) -> None:
        """Stop listening."""
        ...


class RosNode(Protocol):
    """A node; see `node.Node`."""

    @property
    def name(self) -> str:
        """In the graph."""
        ...

    @property
    def log(self) -> EventLog:
        """What went wrong."""
        ...

    @property
    def alive(self) -> bool:
        """False once it was closed, or shut down through ROS."""
        ...

    def publisher(self, topic: str, type_name: str, latch: bool = False, queue: int = ...) -> RosPublisher:
        """Publish a topic."""
        ...

    def subscribe(self, topic: str, type_name: str, callback: Callable[[Any], None] | None = None) -> RosSubscription:
        """Listen to a topic."""
        ...

    def close(self) -> None:
        """Take all back."""
        ...


class Newest:
    """The newest message of a topic, and how many came.

    Attributes:
        received: Messages that came.
    """

    def __init__(self) -> None:
        self.received = 0
        self._lock = threading.Lock()
        self._newest: tuple[int, Any] | None = None
        self._taken = 0

    def put(self, message: Any, came: int = 1) -> None:
        """A message, the last of so many that came."""
        with self._lock:
            self.received += came
            self._newest = (self.received, message)

    def latest(self) -> tuple[int, Any] | None:
        """See `RosSubscription`."""
        return self._newest

    def take(self) -> Any | None:
        """See `RosSubscription`."""
        newest = self._newest
        if newest is None or newest[0] == self._taken:
            return None
        self._taken = newest[0]
        return newest[1]


def open_node(
    name: str, *, master_uri: str | None = None, host: str | None = None, backend: Backend = "auto"
) -> RosNode:
    """A node on the graph of a master.

    Args:
        name: Of the node.
        master_uri: Default `ROS_MASTER_URI`, else this machine's.
        host: Under which others reach it; see `names.own_host`.
        backend: `own`, our client; `rospy`; `auto`, `rospy` where it can be imported.

    Raises:
        InputError: A bad name or backend, `rospy` asked for and absent, or a master that does not answer.
    """
    if backend not in BACKENDS:
        raise InputError(f"backend is {backend!r}; allowed: {', '.join(BACKENDS)}")
    there = find_spec("rospy") is not None
    if backend == "rospy" and not there:
        raise InputError("backend is 'rospy'; allowed: own, as rospy cannot be imported here")
    if backend != "own" and there:
        from otwarp.ros.ros1.rospy_node import RospyNode

        return RospyNode(name, master_uri, host)
    from otwarp.ros.ros1.node import Node

    return Node(name, master_uri, host)
