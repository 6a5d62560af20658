"""Simulated operators and the servo's chain on the device, in float64. Open `hand` first, then `chain`.

What an operator does, one thread for each world and servo period:

    hand          what it sees and feels, plans, and where its hands go
    types         the structs: its constants, the task, what it remembers, what is kept of a trial
    courses       minimum-jerk courses of submovements, paths between their samples
    arm           the passive arm at the device, exact over a period
    ahead         whether a moving obstacle is about to be in the way
    seen          what of the simulation's state chain and eyes get, if all of it
    perception    and what of it, how late and how wrong, if not
    fidelity      how true a force is, against that of a perfect twin
    probing       hands that do no task: moved in sines, or held still
    account       traps as commanded; what is kept of a trial

The arithmetic of `otwarp.haptics.chain`, operation by operation:

    chain         the composed step of one hand
    chain_data    the structs: constants, states, what goes in and out
    orders        a new state, arming, disarming, resetting of worlds
    features      what a chain has, from which its step is composed
    motion        how the traps follow the hand, low-pass filters, virtual coupling
    velocity      velocity of the hand: adaptive windowing
    local_model   the force on the spheres near the hand's traps, and where they have come to since a state
    paper_mode    the public release's force node
    passivity     the energy that the hand is given: counted, controlled and bounded
    safety        arming, ramp, slew limit, clamp, motor guard, watchdog

A part of the chain has constants, one row per hand of a world, and a state, one row per hand of every world; its
functions take a state and return the next. The Python class of the same room of `haptics.chain` says why they do what
they do. Products and sums are kept apart (`fuse_fp`), so that the bits are those of Python, but for `math.dist`, which
rounds better than a root of a sum of squares.
"""
