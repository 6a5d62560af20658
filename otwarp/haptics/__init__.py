"""Haptic rendering: what an operator feels of the forces on trapped spheres, a thousand times per second.

In: samples of a device (m, s) and states of the simulation (µm, mW). Out: a force on the device (N) and places for the
traps (µm). Plain Python numbers only, for nothing here knows of NumPy, Warp or USD: a servo process starts fast and
stays small.

A *side* is left or right: a device, its chain and its traps; the *hand* is the operator's, which moves the device.

The inner rooms, each of which imports only those above it; `chain.chain` is the file to open first:

    core           types, configuration, clocks and priority, shared memory
    force          the local model: the force of a trap on the spheres near it, curves and tables
    chain          from a sample and a state to a force that is safe to send
    recording      the file that a session leaves, and the messages in it
    devices        one file per kind of device, one row each in `devices.KINDS`
    servo          the loop, the process that it runs in, and what passes to and from its parent
    check          what `otwarp haptics check` measures
"""
