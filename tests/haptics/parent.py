"""A parent of a servo, to be killed: publishes a scene and keeps the hand armed until it dies."""

from __future__ import annotations

import json
import time

from otwarp.haptics.core.types import SceneFrame, SphereFrame
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.spring import SpringChain


def main() -> None:
    servo = ServoProcess([HandSetup("virtual:hold,at=0.01/0/0", SpringChain)], spheres=1, traps=1)
    servo.start()
    print(json.dumps(servo.names), flush=True)
    beat = 0
    while True:
        beat += 1
        servo.publish(SceneFrame(beat, 0.001 * beat, (SphereFrame((0.0, 0.0, 0.0), 0),), ()))
        hand = servo.hand(0)
        if hand is not None and hand.state == "disarmed":
            servo.arm()
        time.sleep(0.002)


if __name__ == "__main__":
    main()
