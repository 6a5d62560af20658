"""A Touch behind its ROS 1 driver node: `ros1:/GeomagicLeft` is the namespace of its topics.

Listens to `pose` (geometry_msgs/PoseStamped, millimetres, the device's axes), `joy` and `button`; publishes
`force_feedback` (geomagic_control/DeviceFeedback, N). Buttons: the grey one is bit 0, the white one bit 1.

The driver node of the public release adds 1 N·s/m of damping when a force arrives, and renders the last force for
ever. So the guardian has a publisher of its own on `force_feedback`, which the driver is connected to all the time.

Never run on the hardware: tested against a node that publishes as the driver does.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec

HOME = "otwarp.ros.ros1"
"""Where the ROS client lives, imported when a device is opened: haptics knows of no other room."""
POSE, BUTTON, JOY, FEEDBACK = (
    "geometry_msgs/PoseStamped",
    "geomagic_control/DeviceButtonEvent",
    "sensor_msgs/Joy",
    "geomagic_control/DeviceFeedback",
)
SILENCE = 0.5
"""Seconds without a pose after which the device is lost."""
WAIT = 3.0
"""Seconds that `open` waits for the first pose."""
HEARD_WITHIN = 1.0
"""Seconds in which a driver connects to a new publisher of forces; one that listens later is connected to later."""
GUARDIAN = "_guardian_"
"""What names the guardian's node."""
FARTHEST = 10.0
"""Metres beyond which a pose is not that of a hand."""
TOUCH_FORCE, TOUCH_CONTINUOUS = 3.3, 0.88
"""The Touch by its maker's data sheet [N]."""


def open_client(name: str) -> Any:
    """A ROS 1 node, see `otwarp.ros.ros1.node.Ros1Node`."""
    return import_module(f"{HOME}.node").Ros1Node(name)


class Ros1Device:
    """A device of the paper's driver.

    Args:
        namespace: Of its topics.
        name: As the user named it.
        connect: Makes a node of a name.
        wait: Longest that `open` waits for a pose [s].
    """

    def __init__(
        self,
        namespace: str,
        name: str | None = None,
        *,
        connect: Callable[[str], Any] = open_client,
        wait: float = WAIT,
    ) -> None:
        self._namespace = "/" + namespace.strip("/")
        self._connect, self._wait = connect, wait
        self.info = DeviceInfo(
            name=name or f"ros1:{self._namespace}",
            kind="ros1",
            force=TOUCH_FORCE,
            continuous_force=TOUCH_CONTINUOUS,
        )
        self._node: Any = None
        self._pose: Any = None
        self._feedback: Any = None
        self._types: Any = None
        self._locks: Any = None
        self.address = self._namespace
        self._position: Vec3 = ZERO
        self._buttons = 0
        self._heard: float | None = None

    def open(self) -> None:
        """Connect, and wait for the first pose.

        Raises:
            InputError: The master is not there, the namespace is no name, another node sends forces, or no pose comes.
        """
        self.close()
        node = self._connect(f"{node_name(self._namespace)}_{os.getpid()}")
        try:
            self._types = import_module(f"{HOME}.messages").types()
            self._locks = import_module("numpy").zeros(3, dtype=bool)
            self._pose = node.subscribe(f"{self._namespace}/pose", POSE)
            node.subscribe(f"{self._namespace}/joy", JOY, self._joy)
            node.subscribe(f"{self._namespace}/button", BUTTON, self._button)
            self._feedback = node.publisher(f"{self._namespace}/force_feedback", FEEDBACK, queue=1)
            self._refuse_another_owner(node)
            deadline = time.monotonic() + self._wait
            while self._pose.latest() is None:
                if time.monotonic() > deadline:
                    raise InputError(
                        f"device {self.info.name!r}: no {POSE} on {self._namespace}/pose within {self._wait:g} s"
                    )
                time.sleep(0.01)
        except BaseException:
            node.close()
            raise
        self._node, self._heard = node, None

    def _refuse_another_owner(self, node: Any) -> None:
        """A device has one hand; two nodes that open it at the same time both see the other.

        Raises:
            InputError: Another node sends forces to the driver, which would render now the one's, now the other's.
        """
        topic, guardians = f"{self._namespace}/force_feedback", f"/{node_name(self._namespace)}{GUARDIAN}"
        others = [name for name in node.other_publishers(topic) if not name.startswith(guardians)]
        if others:
            raise InputError(
                f"device {self.info.name!r}: {', '.join(others)} publishes {topic} already; a device has one owner: "
                "end that node first"
            )

    def _joy(self, message: Any) -> None:
        """Buttons as they are, with every pose."""
        self._buttons = sum(1 << n for n, pressed in enumerate(message.buttons[:2]) if pressed)

    def _button(self, message: Any) -> None:
        """Buttons when one changes."""
        self._buttons = (message.grey_button != 0) | (message.white_button != 0) << 1

    def read(self, time: float) -> DeviceSample:
        """See `Device`; a pose that is not finite, or farther than `FARTHEST`, is no word of the device."""
        node = self._node
        if node is None:
            raise DeviceLost(f"{self.info.name} is not open")
        if not node.alive:
            raise DeviceLost(f"{self.info.name}: its ROS node was shut down")
        message = self._pose.take()
        fresh = False
        if message is not None:
            p = message.pose.position
            x, y, z = 1e-3 * p.x, 1e-3 * p.y, 1e-3 * p.z
            if max(abs(x), abs(y), abs(z)) <= FARTHEST and math.isfinite(x + y + z):
                self._position, fresh = (x, y, z), True
        if fresh or self._heard is None:
            self._heard = time
        elif time - self._heard > SILENCE:
            driver = ", ".join(self._pose.peers) or "its driver"
            what = "is connected and silent" if self._pose.connections else "has gone"
            raise DeviceLost(f"driver {driver} {what}: no pose for {SILENCE:g} s")
        return DeviceSample(time, self._position, self._buttons, fresh)

    def write(self, force: Vec3) -> None:
        """See `Device`."""
        if self._node is None:
            raise DeviceLost(f"{self.info.name} is not open")
        t = self._types
        self._feedback.publish(t.DeviceFeedback(t.Vector3(*force), t.Vector3(*ZERO), self._locks))

    def close(self) -> None:
        """See `Device`; the last force is zero."""
        node, self._node = self._node, None
        if node is not None:
            t = self._types
            self._feedback.publish(t.DeviceFeedback(t.Vector3(*ZERO), t.Vector3(*ZERO), self._locks))
            self._buttons = 0
            node.close()


class ZeroFeedback:
    """Zero force on `force_feedback` from a node of its own, connected before it is needed; see `core.ZeroForce`.

    Args:
        namespace: Of the topics.
        connect: Makes a node of a name.

    Raises:
        InputError: The master is not there.
    """

    def __init__(self, namespace: str, connect: Callable[[str], Any] = open_client):
        self._node = connect(f"{node_name(namespace)}{GUARDIAN}{os.getpid()}")
        t = import_module(f"{HOME}.messages").types()
        locks = import_module("numpy").zeros(3, dtype=bool)
        self._zero = t.DeviceFeedback(t.Vector3(*ZERO), t.Vector3(*ZERO), locks)
        self._feedback = self._node.publisher(f"{namespace}/force_feedback", FEEDBACK, queue=1)
        deadline = time.monotonic() + HEARD_WITHIN
        while self._feedback.connections == 0 and time.monotonic() < deadline:
            time.sleep(0.01)

    def send(self) -> None:
        """See `ZeroForce`.

        Raises:
            InputError: No driver listens.
        """
        self._feedback.publish(self._zero)
        if self._feedback.connections == 0:
            raise InputError(f"nobody listens to {self._feedback.topic}")

    def close(self) -> None:
        """See `ZeroForce`."""
        self._node.close()


def zero_force(address: str) -> ZeroFeedback:
    """What the guardian sends."""
    return ZeroFeedback(address)


def node_name(namespace: str) -> str:
    """How the names of our nodes for a device begin."""
    return f"otwarp_{namespace.strip('/').replace('/', '_')}"


def find_devices() -> tuple[str, ...]:
    """One line per device, which begins with the text to ask for it by: namespaces with a `pose` of the right type that
    the master knows; none if there is no master."""
    names = import_module(f"{HOME}.names")
    rpc = import_module(f"{HOME}.rpc")
    try:
        topics = rpc.call(names.master_uri(None), "getPublishedTopics", "/otwarp", "", timeout=1.0)
    except (InputError, rpc.NoAnswer, rpc.Refused):
        return ()
    found = [
        pair[0].removesuffix("/pose")
        for pair in (topics if isinstance(topics, list) else ())
        if isinstance(pair, list) and pair[1:] == [POSE] and str(pair[0]).endswith("/pose") and pair[0] != "/pose"
    ]
    return tuple(f"ros1:{namespace}  (publishes {POSE})" for namespace in sorted(set(found)))


def create(spec: DeviceSpec) -> Ros1Device:
    """`ros1:NAMESPACE`."""
    namespace = (spec.argument or "").strip("/")
    if not namespace or not all(part.isidentifier() and part.isascii() for part in namespace.split("/")):
        raise InputError(f"device {spec.text!r}: namespace is {spec.argument!r}; allowed: a name as /GeomagicLeft")
    return Ros1Device(namespace, spec.text)
