"""Strategy A: two equal traps tilt a rigid pair of spheres out of the plane, less and less as they move apart.

With harmonic traps of stiffness k_r across and k_z = η·k_r along the beam, a pair of length L in traps d apart rests
at cos θ = d/((1 − η)·L) for d < (1 − η)·L and lies flat beyond: a pitchfork, whose sign is free. The spacing grows
slowly through it, so the pair follows the equilibrium. k_r is the exact stiffness of the fitted polymer sphere scaled
to this radius; η is the free parameter of the study, smaller than that sphere's own 0.51.
"""

from __future__ import annotations

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from scenes.author import robots, shapes, trap_laws

LENGTH = 9.55  # L, between the spheres' centres [µm]
RADIUS = 1.525
POWER = 20.0  # per trap [mW]
ETA = 0.2  # k_z / k_r
SPACING = (0.5, 0.95)  # d/L at the start and at the end
DURATION, REST = 6.0, 0.2  # [s]
HEIGHT = 15.0
REACH = 5.0  # of a trap [µm]: its own sphere stays within 3.8, the other beyond 5.9


def tilt(spacing: float) -> float:
    """Angle [rad] at which the pair rests in traps that are `spacing` [µm] apart."""
    return float(np.arccos(min(1.0, spacing / ((1 - ETA) * LENGTH))))


def pair() -> Body:
    """The pair at rest in the first spacing, its +X end up."""
    half = tilt(SPACING[0] * LENGTH) / 2
    turn = tuple(float(v) for v in np.round([0.0, -np.sin(half), 0.0, np.cos(half)], 12))
    ends = (("left", -LENGTH / 2), ("right", LENGTH / 2))
    return Body(
        prim="/World/pair",
        position=(0.0, 0.0, HEIGHT),
        orientation=turn,  # type: ignore[arg-type]
        spheres=tuple(
            Sphere(prim=f"/World/pair/{name}", offset=(x, 0.0, 0.0), radius=RADIUS, refractive_index=1.52)
            for name, x in ends
        ),
        material=robots.RESIST,
        warning_force=10.0,
    )


def traps() -> list[Trap]:
    """Two harmonic traps that part along X."""
    k = trap_laws.STIFFNESS_RADIAL * trap_laws.FITTED_RADIUS / RADIUS
    radial = TrapLaw(stiffness=round(k, 6), cutoff=REACH, power=1.0)
    axial = TrapLaw(stiffness=round(ETA * k, 6), cutoff=REACH, power=1.0)
    start, end = SPACING[0] * LENGTH / 2, SPACING[1] * LENGTH / 2
    times = np.array([0.0, REST, DURATION])
    return [
        Trap(
            prim=f"/World/Traps/{name}",
            position=Track(times=times, values=np.round([[side * x, 0.0, HEIGHT] for x in (start, start, end)], 6)),
            power=Track.constant(POWER),
            model="harmonic",
            radial=radial,
            axial=axial,
            hand=name,  # type: ignore[arg-type]
            holds=f"/World/pair/{name}",
        )
        for name, side in (("left", -1.0), ("right", 1.0))
    ]


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (4.0, -34.0, 22.0), (0.0, 0.0, HEIGHT), field_of_view=38.0)
    body = pair()
    builder.add(body, color=shapes.WARM_ROBOT)
    left, right = (sphere.offset for sphere in body.spheres)
    builder.add_rod(body.prim, "rod", left, right, 0.9, color=shapes.WARM_ROBOT)
    for trap, color in zip(traps(), (shapes.RED_BEAM, shapes.CYAN_BEAM), strict=True):
        builder.add(trap, color=color, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
