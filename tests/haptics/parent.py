"""A parent of a servo, to be killed: publishes a scene and keeps the hand armed until it dies.

    python -m tests.haptics.parent [DEVICE [once]]

Prints the names of the mailboxes and the numbers of the processes; with `once` it arms only at the start, and when it
reads a line.
"""

from __future__ import annotations

import json
import select
import sys
import time

from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.hid_machine import MachineChain
from tests.haptics.spring import SpringChain

AWAY = -10.0
"""Place of the sphere [µm]: a hand that rests at 0 feels 1 N."""


def main(device: str = "virtual:hold,at=0.01/0/0", often: str = "always") -> None:
    hid = device.startswith("dualsense")
    servo = ServoProcess([HandSetup(device, MachineChain if hid else SpringChain)], spheres=1, traps=1)
    servo.start()
    print(json.dumps(servo.names | {"servo": servo.pid, "guardian": servo.guardian}), flush=True)
    beat, again = 0, True
    while True:
        beat += 1
        x = 0.0 if device.startswith("virtual") else AWAY
        traps = (TrapFrame(0, (x, 0.0, 0.0), 20.0),)
        servo.publish(SceneFrame(beat, 0.001 * beat, (SphereFrame((x, 0.0, 0.0), 0),), traps))
        if select.select([sys.stdin], [], [], 0.0)[0]:
            again = bool(sys.stdin.readline())
        hand = servo.hand(0)
        if hand is not None and hand.state == "disarmed" and (again or often == "always"):
            servo.arm()
        again = again and (hand is None or hand.state == "disarmed")
        time.sleep(0.002)


if __name__ == "__main__":
    main(*sys.argv[1:])
