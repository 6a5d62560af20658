"""A master that only registers, peers that misbehave, a node without a network, and patience."""

from __future__ import annotations

import contextlib
import queue
import socket
import socketserver
import threading
import time
import xmlrpc.client
from collections.abc import Callable
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import message_type, types
from otwarp.ros.ros1.subscriber import SubscribedTopic, Subscription
from otwarp.ros.ros1.wire import MOST_MESSAGE, encode_header

PATIENCE = 60.0
"""Seconds until a test gives up; what it waits for takes milliseconds, also on a busy machine seconds at most."""


POLL = 0.05
"""Seconds between looks at the master: often, so that the tests need not wait."""
TWIST = "geometry_msgs/Twist"


def twist(x: float, y: float = 0.0, z: float = 0.0) -> Any:
    """A linear velocity."""
    t = types()
    return t.Twist(t.Vector3(x, y, z), t.Vector3(0.0, 0.0, 0.0))


def expect_soon(condition: Callable[[], Any], what: str = "") -> Any:
    """The condition's first true value."""
    deadline = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s for {what or condition}"
        time.sleep(0.005)
    return value


class _Server(socketserver.ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    allow_reuse_address = True


class _AnyPath(SimpleXMLRPCRequestHandler):
    rpc_paths = ()


class MasterDouble:
    """The registration calls of a master, in this process; written from the ROS wiki's `ROS/Master_API`."""

    def __init__(self) -> None:
        self.port = 0
        self.calls: list[tuple[Any, ...]] = []
        self._updates: dict[str, queue.SimpleQueue[tuple[str, list[str]]]] = {}
        self._lock = threading.Lock()
        self.start()

    @property
    def uri(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def start(self) -> None:
        """Knows nothing of what was before."""
        self.publishers: dict[str, dict[str, tuple[str, str]]] = {}
        self.subscribers: dict[str, dict[str, tuple[str, str]]] = {}
        self._server = _Server(("127.0.0.1", self.port), _AnyPath, logRequests=False, bind_and_activate=True)
        self.port = self._server.server_address[1]
        for name in ("registerPublisher", "registerSubscriber", "unregisterPublisher", "unregisterSubscriber"):
            self._server.register_function(getattr(self, f"_{name}"), name)
        self._server.register_function(lambda caller: [1, "", 4711], "getPid")
        self._server.register_function(self._lookup, "lookupNode")
        self._server.register_function(self._published, "getPublishedTopics")
        self._server.register_function(self._state, "getSystemState")
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _registerPublisher(self, caller: str, topic: str, kind: str, uri: str) -> list[Any]:
        with self._lock:
            self.calls.append(("registerPublisher", caller, topic, kind))
            self.publishers.setdefault(topic, {})[caller] = (uri, kind)
            subscribers = [one[0] for one in self.subscribers.get(topic, {}).values()]
        self._update_subscribers(topic)
        return [1, "", subscribers]

    def _registerSubscriber(self, caller: str, topic: str, kind: str, uri: str) -> list[Any]:
        with self._lock:
            self.calls.append(("registerSubscriber", caller, topic, kind))
            self.subscribers.setdefault(topic, {})[caller] = (uri, kind)
            return [1, "", [one[0] for one in self.publishers.get(topic, {}).values()]]

    def _unregisterPublisher(self, caller: str, topic: str, uri: str) -> list[Any]:
        with self._lock:
            self.calls.append(("unregisterPublisher", caller, topic))
            self.publishers.get(topic, {}).pop(caller, None)
        self._update_subscribers(topic)
        return [1, "", 1]

    def _unregisterSubscriber(self, caller: str, topic: str, uri: str) -> list[Any]:
        with self._lock:
            self.calls.append(("unregisterSubscriber", caller, topic))
            self.subscribers.get(topic, {}).pop(caller, None)
        return [1, "", 1]

    def _lookup(self, caller: str, name: str) -> list[Any]:
        with self._lock:
            for registered in (*self.publishers.values(), *self.subscribers.values()):
                if name in registered:
                    return [1, "", registered[name][0]]
        return [-1, f"unknown node [{name}]", ""]

    def _published(self, caller: str, subgraph: str) -> list[Any]:
        with self._lock:
            return [1, "", [[topic, kind] for topic, nodes in self.publishers.items() for _, kind in nodes.values()]]

    def _state(self, caller: str) -> list[Any]:
        with self._lock:
            books = [
                [[topic, list(nodes)] for topic, nodes in of.items()] for of in (self.publishers, self.subscribers)
            ]
        return [1, "", [*books, []]]

    def _update_subscribers(self, topic: str) -> None:
        """Tell subscribers of a topic who publishes it, as a master does: each in a thread of its own, in order."""
        with self._lock:
            publishers = [one[0] for one in self.publishers.get(topic, {}).values()]
            for uri in [one[0] for one in self.subscribers.get(topic, {}).values()]:
                if uri not in self._updates:
                    self._updates[uri] = queue.SimpleQueue()
                    threading.Thread(target=_update, args=(uri, self._updates[uri]), daemon=True).start()
                self._updates[uri].put((topic, publishers))


def _update(uri: str, news: queue.SimpleQueue[tuple[str, list[str]]]) -> None:
    while True:
        topic, publishers = news.get()
        with contextlib.suppress(OSError, xmlrpc.client.Error), xmlrpc.client.ServerProxy(uri) as node:
            node.publisherUpdate("/master", topic, publishers)


class BadPublisher:
    """A node whose topic answers each subscriber with given bytes and hangs up.

    Args:
        answers: Bytes for the first, second, … subscriber; the last ones for all after it.
    """

    def __init__(self, *answers: bytes) -> None:
        self._answers, self.asked = answers, 0
        self._socket = socket.create_server(("127.0.0.1", 0))
        port = self._socket.getsockname()[1]
        self._server = _Server(("127.0.0.1", 0), _AnyPath, logRequests=False)
        self._server.register_function(lambda *_: [1, "", ["TCPROS", "127.0.0.1", port]], "requestTopic")
        self._server.register_function(lambda *_: [1, "", 0], "publisherUpdate")
        self.uri = f"http://127.0.0.1:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            try:
                sock, _ = self._socket.accept()
            except OSError:
                return
            with sock, contextlib.suppress(OSError):
                sock.settimeout(PATIENCE)
                sock.recv(1 << 16)
                sock.sendall(self._answers[min(self.asked, len(self._answers) - 1)])
                self.asked += 1
                sock.shutdown(socket.SHUT_WR)
                sock.recv(1 << 16)

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def good_header(type_name: str, **changed: str) -> bytes:
    """What a publisher of a type answers."""
    kind = message_type(type_name)
    return encode_header({"type": kind.name, "md5sum": kind.md5, "callerid": "/bad", "latching": "0"} | changed)


class LocalPublisher:
    """Publisher of a `LocalNode`."""

    def __init__(self, node: LocalNode, topic: str, type_name: str) -> None:
        self._node, self.topic, self.type = node, topic, message_type(type_name)

    def publish(self, message: Any) -> None:
        body = self.type.encode(message)
        self._node.sent.setdefault(self.topic, []).append(self.type.decode(body))

    def close(self) -> None:
        self._node.closed.append(self.topic)


class LocalNode:
    """A node without threads or network: what is published is kept, what comes is said by `say`."""

    name, alive = "/local", True

    def __init__(self) -> None:
        self.log = EventLog()
        self.sent: dict[str, list[Any]] = {}
        self.subscribed: dict[str, SubscribedTopic] = {}
        self.closed: list[str] = []
        self.others: list[str] = []

    def other_publishers(self, topic: str) -> list[str]:
        return self.others

    def publisher(self, topic: str, type_name: str, latch: bool = False, queue: int = 16) -> LocalPublisher:
        return LocalPublisher(self, topic, type_name)

    def subscribe(self, topic: str, type_name: str, callback: Callable[[Any], None] | None = None) -> Subscription:
        kind, release = message_type(type_name), lambda subscribed: self.closed.append(subscribed.name)
        self.subscribed[topic] = SubscribedTopic(
            topic, kind, caller=self.name, most=MOST_MESSAGE, log=self.log, release=release
        )
        return self.subscribed[topic].join(callback)

    def say(self, topic: str, message: Any) -> None:
        """A message as if it had come over the wire."""
        subscribed = self.subscribed[topic]
        subscribed.deliver([subscribed.type.encode(message)], None)

    def close(self) -> None:
        self.alive = False
