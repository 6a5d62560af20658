"""A node of ROS 1 that needs no ROS: it registers with a master, publishes, subscribes, and comes back after restarts.

    with Ros1Node("otwarp") as node:
        out = node.publisher("/robot01", "tf2_msgs/TFMessage")
        node.subscribe("/GeomagicLeft/smoothed_twist", "geometry_msgs/Twist", print)
        out.publish(message)

After the ROS wiki, `ROS/Master_API`, `ROS/Slave_API`, `ROS/TCPROS`. IPv4, TCPROS only; no services, no parameters.
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
from typing import Any

from otwarp.errors import InputError
from otwarp.ros.ros1 import names
from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import message_type
from otwarp.ros.ros1.names import MASTER, global_name, own_host
from otwarp.ros.ros1.publisher import QUEUE, Publisher, TopicServer
from otwarp.ros.ros1.rpc import NoAnswer, Refused, SlaveServer, call
from otwarp.ros.ros1.subscriber import Callback, SubscribedTopic, Subscription
from otwarp.ros.ros1.wire import MOST_MESSAGE

POLL = 1.0
"""Seconds between two looks whether the master still knows this node."""
MASTER_TIMEOUT = 3.0
"""Seconds that the master may take for an answer."""
LINGER = 0.2
"""Seconds that `close` gives to messages which are still queued."""


class Ros1Node:
    """A node of ROS 1.

    Args:
        name: Of the node, unique in the graph: the master shuts down an older one of that name; a relative one is in
            `ROS_NAMESPACE`.
        master_uri: Default `ROS_MASTER_URI`, else this machine's.
        host: Name or address under which others reach this node and on which alone it listens; see `names.own_host`.
        poll: Seconds between two looks at the master.
        most: Largest message accepted [bytes].

    Attributes:
        log: What went wrong, bounded.
        uri: Of its slave server.
        master_there: Whether the master answered last time.

    Raises:
        InputError: A bad name, URI or host, no `rosbags`, or a master that does not answer.
    """

    def __init__(
        self,
        name: str,
        master_uri: str | None = None,
        host: str | None = None,
        *,
        poll: float = POLL,
        most: int = MOST_MESSAGE,
    ) -> None:
        self.name = names.node_name(name)
        self.master = names.master_uri(master_uri)
        self.host, address = own_host(host, self.master)
        self.log = EventLog()
        self.master_there = True
        self._complaint = ""
        self._poll, self._most = poll, most
        self._lock = threading.RLock()
        self._publishers: dict[str, Publisher] = {}
        self._subscribed: dict[str, SubscribedTopic] = {}
        self._stopped = threading.Event()
        check_master(self.master, self.name)
        try:
            self._topics = TopicServer(address, self.name, lambda topic: self._publishers.get(topic), self.log)
            try:
                self._slave = SlaveServer(address, self._methods(), self.log)
            except BaseException:
                self._topics.close()
                raise
        except OSError as error:
            raise InputError(f"host is {self.host!r}: cannot listen there ({error.strerror})") from None
        self.uri = f"http://{self.host}:{self._slave.server_address[1]}/"
        self._monitor = threading.Thread(target=self._follow_master, name="ros1-master", daemon=True)
        self._monitor.start()

    @property
    def alive(self) -> bool:
        """False once it was closed, or shut down through ROS."""
        return not self._stopped.is_set()

    def publisher(self, topic: str, type_name: str, latch: bool = False, queue: int = QUEUE) -> Publisher:
        """Publish a topic.

        Args:
            topic: Its name.
            type_name: As `geometry_msgs/Twist`.
            latch: Whether a new subscriber gets the last message at once.
            queue: Messages that wait for a subscriber before the oldest is dropped, and counted.

        Raises:
            InputError: A bad name or type, a topic that is published already, or a master that is gone.
        """
        topic, kind = global_name("topic", topic), message_type(type_name)
        publisher = Publisher(topic, kind, latch=latch, queue=queue, log=self.log, release=self._release_publisher)
        with self._lock:
            self._check_alive()
            if topic in self._publishers:
                raise InputError(f"topic is {topic!r}; allowed: one that this node does not publish yet")
            self._publishers[topic] = publisher
        try:
            self._register_publisher(publisher)
        except (NoAnswer, Refused) as error:
            publisher.close()
            raise InputError(f"{MASTER} is {self.master!r}: {error}") from None
        return publisher

    def subscribe(self, topic: str, type_name: str, callback: Callback | None = None) -> Subscription:
        """Listen to a topic.

        Args:
            topic: Its name.
            type_name: As `geometry_msgs/Twist`.
            callback: Takes each message, in a thread of its own; None keeps only the newest.

        Raises:
            InputError: A bad name or type, or a master that is gone.
        """
        topic, kind = global_name("topic", topic), message_type(type_name)
        with self._lock:
            self._check_alive()
            before = self._subscribed.get(topic)
            if before is not None and before.type is not kind:
                raise InputError(f"type of {topic} is {type_name!r}; allowed: {before.type.name}, as subscribed before")
            subscribed = before or SubscribedTopic(
                topic, kind, caller=self.name, most=self._most, log=self.log, release=self._release_subscriber
            )
            self._subscribed[topic] = subscribed
            subscription = subscribed.join(callback)
        if before is None:
            try:
                self._register_subscriber(subscribed)
            except (NoAnswer, Refused) as error:
                subscription.close()
                raise InputError(f"{MASTER} is {self.master!r}: {error}") from None
        return subscription

    def other_publishers(self, topic: str) -> list[str]:
        """Names of the nodes, besides this one, that publish a topic and live: a master keeps those that were killed.

        Raises:
            InputError: The master is gone.
        """
        try:
            publishers, *_ = self._ask("getSystemState")
            names_of = {name: nodes for name, nodes in publishers}
            return [node for node in names_of.get(topic, []) if node != self.name and self._lives(node)]
        except (NoAnswer, Refused, TypeError, ValueError) as error:
            raise InputError(f"{MASTER} is {self.master!r}: {error}") from None

    def _lives(self, node: str) -> bool:
        """Whether somebody takes connections where a node is registered; one that is stopped does, and lives."""
        try:
            where = names.address(self._ask("lookupNode", node))
        except Refused:
            return False
        if where is None:
            return False
        try:
            socket.create_connection(where, timeout=MASTER_TIMEOUT).close()
        except TimeoutError:
            return True
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Send what is queued for at most `LINGER`, take all registrations back and stop; may be called again."""
        with self._lock:
            if self._stopped.is_set():
                return
            self._stopped.set()
            publishers = list(self._publishers.values())
            subscribed = list(self._subscribed.values())
        if threading.current_thread() is not self._monitor:
            self._monitor.join(MASTER_TIMEOUT)  # lest it register what is taken back here
        deadline = time.monotonic() + LINGER
        for publisher in publishers:
            publisher.flush(deadline - time.monotonic())
        for one in (*subscribed, *publishers):
            one.close()
        self._topics.close()
        self._slave.close()

    def __enter__(self) -> Ros1Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_alive(self) -> None:
        if self._stopped.is_set():
            raise InputError(f"node {self.name} is closed")

    # registrations with the master

    def _ask(self, method: str, *arguments: Any) -> Any:
        return call(self.master, method, self.name, *arguments, timeout=MASTER_TIMEOUT)

    def _register_publisher(self, publisher: Publisher) -> None:
        self._ask("registerPublisher", publisher.topic, publisher.type.name, self.uri)

    def _register_subscriber(self, topic: SubscribedTopic) -> None:
        publishers = self._ask("registerSubscriber", topic.name, topic.type.name, self.uri)
        if not isinstance(publishers, list) or not all(isinstance(uri, str) for uri in publishers):
            raise NoAnswer("registerSubscriber: no list of URIs")
        topic.publishers(publishers)

    def _release_publisher(self, publisher: Publisher) -> None:
        with self._lock:
            if self._publishers.get(publisher.topic) is publisher:
                del self._publishers[publisher.topic]
        self._unregister("unregisterPublisher", publisher.topic)

    def _release_subscriber(self, topic: SubscribedTopic) -> None:
        with self._lock:
            if self._subscribed.get(topic.name) is topic:
                del self._subscribed[topic.name]
        self._unregister("unregisterSubscriber", topic.name)

    def _unregister(self, method: str, topic: str) -> None:
        """Take a registration back, if the master is there: one that is gone has forgotten it."""
        if self.master_there:
            try:
                self._ask(method, topic, self.uri)
            except (NoAnswer, Refused) as error:
                self.master_there = False
                self.log.note("master", str(error))

    def _follow_master(self) -> None:
        """Register anew with a master that has restarted."""
        while not self._stopped.wait(self._poll):
            try:
                known = self._ask("lookupNode", self.name)
            except Refused:
                known = None
            except NoAnswer as error:
                if self.master_there:
                    self.master_there = False
                    self.log.note("master", f"gone; topics that are connected go on without it ({error})")
                continue
            if known == self.uri and self.master_there:
                self._complaint = ""
            elif known not in (None, self.uri):
                self._complain(f"another node took the name {self.name}")
            else:
                self.master_there = self._register_all()

    def _complain(self, line: str) -> None:
        """Note what the master would not, once: it is asked again at every look."""
        if line != self._complaint:
            self._complaint = line
            self.log.note("master", line)

    def _register_all(self) -> bool:
        """Whether the master took all registrations."""
        with self._lock:
            publishers = list(self._publishers.values())
            subscribed = list(self._subscribed.values())
        try:
            for publisher in publishers:
                self._register_publisher(publisher)
            for topic in subscribed:
                self._register_subscriber(topic)
        except (NoAnswer, Refused) as error:
            self._complain(f"did not take a registration: {error}")
            return False
        self._complaint = ""
        done = f"registered anew, topics published: {len(publishers)}, subscribed: {len(subscribed)}"
        if not self.master_there:
            self.log.note("master", f"back; {done}")
        elif publishers or subscribed:
            self.log.note("master", done)
        return True

    # what others may ask of this node

    def _methods(self) -> dict[str, Any]:
        def _shutdown(caller: str, reason: str = "") -> list[Any]:
            _strings(caller, reason)
            self.log.note("master", f"shut down by {caller}: {reason}")
            threading.Thread(target=self.close, name="ros1-close", daemon=True).start()
            return [1, "", 0]

        def _publisher_update(caller: str, topic: str, publishers: list[str]) -> list[Any]:
            if not isinstance(publishers, list):
                raise TypeError("no list of URIs")
            _strings(caller, topic, *publishers)
            with self._lock:
                subscribed = self._subscribed.get(topic)
            if subscribed is not None:
                subscribed.publishers(publishers)
            return [1, "", 0]

        def _request_topic(caller: str, topic: str, protocols: list[Any]) -> list[Any]:
            _strings(caller, topic)
            if not isinstance(protocols, list):
                raise TypeError("no list of protocols")
            if topic not in self._publishers:
                return [0, f"{self.name} does not publish {topic[:80]}", []]
            if not any(isinstance(p, list) and p[:1] == ["TCPROS"] for p in protocols):
                return [0, "only TCPROS", []]
            return [1, "", ["TCPROS", self.host, self._topics.port]]

        def _topics(of: dict[str, Any]) -> list[list[str]]:
            with self._lock:
                return [[topic, one.type.name] for topic, one in of.items()]

        return {
            "shutdown": _shutdown,
            "publisherUpdate": _publisher_update,
            "requestTopic": _request_topic,
            "getPublications": lambda caller: [1, "", _topics(self._publishers)],
            "getSubscriptions": lambda caller: [1, "", _topics(self._subscribed)],
            "getMasterUri": lambda caller: [1, "", self.master],
            "getPid": lambda caller: [1, "", os.getpid()],
            "getBusStats": lambda caller: [1, "", [[], [], []]],
            "getBusInfo": lambda caller: [1, "", []],
            "paramUpdate": lambda caller, key, value: [1, "", 0],
        }


def check_master(uri: str, caller: str = "/otwarp") -> None:
    """See that a master answers.

    Raises:
        InputError: None does; one line that names `ROS_MASTER_URI` and its value.
    """
    with contextlib.suppress(Refused):
        try:
            call(uri, "getPid", caller, timeout=MASTER_TIMEOUT)
        except NoAnswer as error:
            raise InputError(f"{MASTER} is {uri!r}: no ROS master answers there ({error})") from None


def _strings(*values: object) -> None:
    for value in values:
        if not isinstance(value, str):
            raise TypeError(f"{type(value).__name__} where a string belongs")
