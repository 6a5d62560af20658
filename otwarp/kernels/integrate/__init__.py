"""Time integrators, and any body as one kind of thing to integrate.

integrators (`INTEGRATORS`; open this first) composes the functions of schemes over a `Dynamics`; body joins lone
spheres, rigid bodies and walls into one.
"""
