"""A ROS 2 node as the rest of otwarp sees it: publishers and subscriptions that never block.

Cyclone DDS receives on its own threads into a cache of a few messages; `take` empties that cache. What can be seen of a
node from ROS 2: its topics, types and QoS, since those come from DDS discovery. What cannot: its name in
`ros2 node list`, since ROS 2 learns names from the topic `ros_discovery_info`, whose message has changed its layout
between distributions (Gid of 24 bytes up to Humble, 16 since Iron) under one name, and is not published here.
"""

from __future__ import annotations

import importlib
import os
import threading
from types import ModuleType
from typing import Any

from otwarp.errors import InputError
from otwarp.ros.ros2.cyclonedds_internals import delete, take
from otwarp.ros.ros2.dds import (
    RELIABLE,
    SENSOR_DATA,
    QoS,
    check_node_name,
    cyclone_config,
    cyclone_qos,
    dds_topic,
    domain_id,
    resolve_topic,
)

ENCLAVE = b"enclave=/;"
"""User data of a participant of ROS 2; `rmw_fastrtps_cpp` ignores participants without it in its graph."""

_domains: dict[int, tuple[Any, int]] = {}
"""Domains that this process has configured, and the nodes in each: Cyclone configures a domain once per process."""
_domains_lock = threading.Lock()


def load_messages() -> ModuleType:
    """The module of the messages, `otwarp.ros.ros2.messages`.

    Raises:
        InputError: `cyclonedds` is not installed.
    """
    try:
        return importlib.import_module("otwarp.ros.ros2.messages")
    except ImportError as error:
        raise InputError(f"ROS 2 needs cyclonedds ({error}); install it with: pip install 'otwarp[ros2]'") from None


def _hold_domain(number: int) -> None:
    """Configure a domain from the environment, unless this process already has."""
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    with _domains_lock:
        domain, users = _domains.get(number, (None, 0))
        if users == 0 and (config := cyclone_config(os.environ)) is not None:
            try:
                domain = Domain(number, config)
            except DDSException as error:
                # somebody else's use of Cyclone in this process has configured it: that stands
                if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                    raise InputError(f"domain is {number}; Cyclone DDS cannot open it: {error.msg}") from None
        _domains[number] = (domain, users + 1)


def _drop_domain(number: int) -> None:
    """Delete a domain when its last node has left."""
    with _domains_lock:  # or somebody who joins meanwhile would lose it
        domain, users = _domains[number]
        if users == 1:
            if domain is not None:
                delete(domain)
            del _domains[number]
        else:
            _domains[number] = (domain, users - 1)


class Publisher:
    """Sends messages of one type to one topic.

    Attributes:
        topic: Its full ROS 2 name.
        sent: Messages given to DDS.
        dropped: Messages that a reliable writer had no room for. Cyclone may say so rather than wait; with the bounded
            histories used here we have not seen it.
    """

    def __init__(self, writer: Any, topic: str, kind: type):
        self._writer, self._kind = writer, kind
        self.topic, self.sent, self.dropped = topic, 0, 0

    @property
    def matched(self) -> int:
        """Readers that it sends to now."""
        return 0 if self._writer is None else len(self._writer.get_matched_subscriptions())

    def publish(self, message: Any) -> None:
        """Send a message; returns at once, whoever listens.

        Raises:
            InputError: A message of another type, a field that its type cannot hold, or a node that is closed.
        """
        if self._writer is None:
            raise InputError(f"publisher of {self.topic} is closed; allowed: publish before close")
        if not isinstance(message, self._kind):
            raise InputError(f"message for {self.topic} is a {type(message).__name__}; allowed: {self._kind.__name__}")
        from cyclonedds.core import DDSException

        try:
            self._writer.write(message)
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_TIMEOUT:
                self.dropped += 1
                return
            raise InputError(f"message for {self.topic} was refused by Cyclone DDS: {error.msg}") from None
        except Exception as error:  # cyclonedds raises plain Exception for a value that its type cannot hold
            raise InputError(f"message for {self.topic} does not fit {self._kind.__name__}: {error}") from None
        self.sent += 1

    def close(self) -> None:
        """Leave the topic; may be called more than once."""
        if self._writer is not None:
            delete(self._writer)
            delete(self._writer.topic)
            self._writer = None


class Subscription:
    """Receives messages of one type from one topic.

    Attributes:
        topic: Its full ROS 2 name.
        received: Messages taken.
        malformed: Messages that came and could not be read; they are dropped.
    """

    def __init__(self, reader: Any, topic: str, kind: Any, depth: int):
        self._reader, self._kind, self._depth = reader, kind, depth
        self.topic, self.received, self.malformed = topic, 0, 0

    @property
    def matched(self) -> int:
        """Writers that it hears now."""
        return 0 if self._reader is None else len(self._reader.get_matched_publications())

    def take(self) -> list[Any]:
        """All messages that have come since the last call and are still kept, oldest first; never waits.

        Raises:
            InputError: The node is closed.
        """
        messages, reader = [], self._reader
        if reader is None:
            raise InputError(f"subscription of {self.topic} is closed; allowed: take before close")
        # a bound, so that a peer that sends faster than it is read cannot keep the caller here
        for _ in range(self._depth):
            data = take(reader)
            if data is None:
                break
            if not data:  # a writer has ended
                continue
            try:
                messages.append(self._kind.deserialize(data))
            except Exception:  # struct.error, UnicodeDecodeError, …: whatever bytes from the network can raise
                self.malformed += 1
        self.received += len(messages)
        return messages

    def latest(self) -> Any | None:
        """The newest message since the last call, None if none has come; the older ones are dropped."""
        messages = self.take()
        return messages[-1] if messages else None

    def close(self) -> None:
        """Leave the topic; may be called more than once."""
        if self._reader is not None:
            delete(self._reader)
            delete(self._reader.topic)
            self._reader = None


class Ros2Node:
    """A participant of a ROS 2 domain.

    Args:
        name: Of the node; DDS carries it as the participant's entity name.
        domain: 0 to 232; None takes `ROS_DOMAIN_ID`, else 0.

    Raises:
        InputError: A bad name, domain or discovery variable, `cyclonedds` not installed, or a network that DDS cannot
            use; one line.
    """

    def __init__(self, name: str, domain: int | None = None):
        self.name = check_node_name(name)
        self.domain = domain_id(domain, os.environ)
        self._messages = load_messages()
        self._ends: list[Publisher | Subscription] = []
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.qos import Policy, Qos

        _hold_domain(self.domain)
        try:
            qos = Qos(Policy.Userdata(ENCLAVE), Policy.EntityName(self.name))
            self._participant: Any = DomainParticipant(self.domain, qos)
        except BaseException as error:
            _drop_domain(self.domain)
            if isinstance(error, DDSException):
                raise InputError(f"domain is {self.domain}; Cyclone DDS cannot join it: {error.msg}") from None
            raise

    def publisher(self, topic: str, kind: str | type, qos: QoS = RELIABLE) -> Publisher:
        """A publisher.

        Args:
            topic: ROS 2 name, as `/rl_vel`.
            kind: A class of `messages.TOPIC_TYPES` or its ROS 2 name, as `geometry_msgs/msg/Twist`.
            qos: Offered policies.

        Raises:
            InputError: A bad name or type, or a node that is closed.
        """
        from cyclonedds.pub import DataWriter

        cls, dds, user_data = self._topic(topic, kind, qos)
        writer = DataWriter(self._participant, dds, cyclone_qos(qos, user_data=user_data, reader=False))
        end = Publisher(writer, resolve_topic(topic), cls)
        self._ends.append(end)
        return end

    def subscribe(self, topic: str, kind: str | type, qos: QoS = SENSOR_DATA) -> Subscription:
        """A subscription.

        Args:
            topic: ROS 2 name.
            kind: As for `publisher`.
            qos: Requested policies.

        Raises:
            InputError: A bad name or type, or a node that is closed.
        """
        from cyclonedds.sub import DataReader

        cls, dds, user_data = self._topic(topic, kind, qos)
        reader = DataReader(self._participant, dds, cyclone_qos(qos, user_data=user_data, reader=True))
        end = Subscription(reader, resolve_topic(topic), cls, qos.depth)
        self._ends.append(end)
        return end

    def _topic(self, topic: str, kind: str | type, qos: QoS) -> tuple[Any, Any, bytes]:
        """Class of a type, the DDS topic, and the user data where ROS 2 since Iron looks for the hash of the type."""
        from cyclonedds.topic import Topic

        if self._participant is None:
            raise InputError(f"node {self.name} is closed; allowed: {topic!r} before close")
        if not isinstance(qos, QoS):
            raise InputError(f"qos of {topic!r} is {qos!r}; allowed: a QoS, as SENSOR_DATA or RELIABLE")
        known = self._messages.TOPIC_TYPES
        name = kind if isinstance(kind, str) else next((name for name, cls in known.items() if cls is kind), None)
        if name not in known:
            raise InputError(f"type of {topic!r} is {kind!r}; allowed: {', '.join(known)}")
        hashed = f"typehash=RIHS01_{self._messages.TYPE_HASHES[name]};"
        return known[name], Topic(self._participant, dds_topic(topic), known[name]), hashed.encode()

    def close(self) -> None:
        """Leave the domain; may be called more than once."""
        if self._participant is None:
            return
        for end in self._ends:
            end.close()
        delete(self._participant)
        self._ends.clear()
        self._participant = None
        _drop_domain(self.domain)

    def __enter__(self) -> Ros2Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
