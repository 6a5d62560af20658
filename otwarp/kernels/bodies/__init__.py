"""How one free body drifts and diffuses: lone spheres, rigid bodies, and the flow that carries them.

In: constants and forces. Out: `Dynamics` for an integrator. Open bead first; rigid is the same with rotation,
whose noise is in rotational_noise; flow holds the profiles.
"""
