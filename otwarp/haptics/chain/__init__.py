"""The signal chain of one side: a device's sample and the newest state in, a force that is safe to send out.

    chain         `Chain`, and `make_chain` for a device; to begin with, open this
    motion        low-pass, velocity, virtual coupling, and how the traps follow
    passivity     the energy that the hand is given: counted, controlled and bounded
    safety        arming, ramp, slew limit, clamp, motor guard and watchdog
    paper_mode    the public release's force node, for comparison
    rendering     a chain as the servo keeps it and a replay runs it again: made, armed, checked, dropped

What a part remembers from one step to the next is its `state()`, which `restore()` takes back bit for bit.
"""
