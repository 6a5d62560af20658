"""A servo on a virtual clock for the tests: devices that tell what they were told, a simulation, a parent."""

from __future__ import annotations

import math
from itertools import pairwise

from otwarp.errors import InputError
from otwarp.haptics.core import DeviceInfo, SceneFrame, SphereFrame
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices.virtual import HandModel, VirtualDevice
from otwarp.haptics.servo.hand import Hand
from otwarp.haptics.servo.link import HandLayout, Orders, OrdersLayout, SceneLayout, SceneReader, StatusLayout
from otwarp.haptics.servo.servo import Servo
from tests.haptics.spring import SpringChain

PERIOD = 0.001
CYCLE = 1.5 * PERIOD
"""Slack of an event that may fall on one cycle or the next, as sums of periods round."""
NAN = float("nan")


class Traced(VirtualDevice):
    """A hand held 10 mm off the sphere, of which the last order, losses and absence can be written and read."""

    def __init__(self, x: float = 0.01, info: DeviceInfo | None = None):
        super().__init__(lambda _: (x, 0.0, 0.0), HandModel(mass=0.0), info)
        self.written: list[tuple[float, float]] = []
        self.opens = 0
        self.away: type[Exception] | None = None
        self.time = 0.0

    def open(self):
        self.opens += 1
        if self.away:
            raise InputError(f"{self.info.name}: not there")
        super().open()

    def read(self, time):
        self.time = time
        if self.away:
            raise self.away("unplugged")
        return super().read(time)

    def write(self, force):
        super().write(force)
        self.written.append((self.time, force[0]))

    @property
    def closed(self):
        return not self._opened


class Rig:
    """A servo on a virtual clock, with a simulation that publishes every 4 ms, and a parent that gives orders."""

    def __init__(self, devices, chain=SpringChain, late=None, orphaned=lambda: False, beside=False):
        n = len(devices)
        self.clock, self.devices = VirtualClock(late=late), devices
        layouts = SceneLayout(2, 2), OrdersLayout(n), StatusLayout(n)
        self.scenes, self.orders, self.status = (Mailbox.create(layout) for layout in layouts)
        self.boxes = [Mailbox.create(HandLayout(2)) for _ in devices]
        self.told = Orders(0, (0,) * n, (0,) * n)
        self.hands = [Hand(d, chain, box, beside) for d, box in zip(devices, self.boxes, strict=True)]
        self.servo = Servo(
            self.clock, self.hands, SceneReader(self.scenes), self.orders, self.status, orphaned=orphaned, grants="none"
        )
        self.script: list[tuple[float, object]] = []
        self.publishing = self.heartbeats = True
        self.beat, self.next_scene, self.x = 0, 0.0, 0.0
        self.states = [[] for _ in devices]
        sleep = self.clock.sleep_until

        def between(deadline):
            self.world()
            sleep(deadline)

        self.clock.sleep_until = between
        self.world()

    def world(self):
        """What happens outside of the servo between two cycles."""
        now = self.clock.now()
        for i, box in enumerate(self.boxes):
            state = box.read()
            if state is not None:
                self.states[i].append((now, state))
        while self.script and self.script[0][0] <= now + 1e-9:
            self.script.pop(0)[1]()
        if self.publishing and now >= self.next_scene - 1e-9:
            self.next_scene = now + 0.004
            self.beat += 1
            self.scenes.write(SceneFrame(self.beat, now, (SphereFrame((self.x, 0.0, 0.0), 0),), ()))
        if self.heartbeats:
            self.tell()

    def tell(self, **order):
        self.told = self.told.next(**order)
        self.orders.write(self.told)

    def run(self, *script):
        """Run with `(time, action)` in order of time, the last of which stops it."""
        self.script = list(script)
        self.servo.run()
        self.world()
        return self

    def arm(self, hand=0):
        return lambda: self.tell(arm=hand)

    def stop(self):
        self.tell(stop=True)

    def set(self, **values):
        return lambda: self.__dict__.update(values)

    def force(self, time, hand=0):
        """What the device was last told by then."""
        return [f for t, f in self.devices[hand].written if t <= time + 1e-9][-1]

    def state(self, time, hand=0):
        return [s for t, s in self.states[hand] if t <= time + 1e-9][-1]


def steps(rig, hand=0):
    forces = [f for _, f in rig.devices[hand].written]
    return [abs(b - a) for a, b in pairwise(forces)]


class Breaking(SpringChain):
    """Fails in one way at 0.2 s of the servo's time, if it was made before."""

    how = "raise"

    def step(self, sample, scene):
        state = super().step(sample, scene)
        if 0.2 < sample.time < 0.25:
            if self.how == "raise":
                raise ZeroDivisionError("0/0")
            fields = {name: getattr(state, name) for name in state.__slots__}
            if self.how == "trap":
                fields["traps"] = ((0, (0.0, math.inf, 0.0)),)
            else:
                fields["force"] = {"nan": (NAN, 0.0, 0.0), "huge": (1e200, 0.0, 0.0)}[self.how]
            return type(state)(**fields)
        return state
