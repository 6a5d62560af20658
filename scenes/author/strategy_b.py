"""Strategy B: two traps of power ratio 1.5 on the handles of a five-element robot, whose spacing shrinks.

For two spheres in harmonic traps the tilt does not depend on the power ratio. It does here, because the laws have a
threshold and the traps come within reach of the arms as well as the handles: the tilt sets in at a wider spacing, and
unequal powers choose its sign. The laws are the study's own numbers, not a fit: axially softer than the fitted ones,
with which the weaker trap loses its handle at d = 0.78 of the span while the robot still lies flat. Nothing but
drag keeps the robot from turning about the line of its handles; the tilt studied is that of this line.
"""

from __future__ import annotations

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Track, Trap
from scenes.author import robots, shapes, trap_laws

POWER_RATIO = 1.5  # m: left over right
TOTAL_POWER = 40.0  # of both traps [mW]
ETA = 0.1  # axial over radial stiffness
RADIAL_THRESHOLD, RADIAL_CUTOFF = 1.6, 2.2  # for a handle [µm]
AXIAL_THRESHOLD, AXIAL_CUTOFF = 2.5, 4.0
SPACING = (1.0, 0.79)  # d/span at the start and at the end
DURATION, REST = 6.0, 0.2  # [s]
HEIGHT = 15.0


def robot() -> Body:
    """The robot, level, its five elements in one plane so that the arms come within reach of the traps."""
    return robots.five_element_robot("/World/robot", (0.0, 0.0, HEIGHT), sweep=0.0)


def laws() -> tuple[TrapLaw, TrapLaw]:
    """Radial and axial law for spheres the size of a handle; arms and hub feel them by similarity."""
    radius = robots.HANDLE_RADIUS
    k = round(trap_laws.STIFFNESS_RADIAL * trap_laws.FITTED_RADIUS / radius, 6)
    return (
        trap_laws.continuous_law(k, RADIAL_THRESHOLD, RADIAL_CUTOFF, radius=radius),
        trap_laws.continuous_law(round(ETA * k, 6), AXIAL_THRESHOLD, AXIAL_CUTOFF, radius=radius),
    )


def traps() -> list[Trap]:
    """A trap on either handle; both move inwards along Y."""
    right = TOTAL_POWER / (1 + POWER_RATIO)
    powers = {"left": TOTAL_POWER - right, "right": right}
    inwards = [(1 - part) * robots.HANDLE_SPAN / 2 for part in SPACING]
    times = np.array([0.0, REST, DURATION])
    return [
        robots.trap_on(
            robot(),
            f"handle_{name}",
            f"/World/Traps/{name}",
            power=powers[name],
            path=Track(times=times, values=np.array([(0.0, side * x, 0.0) for x in (inwards[0], *inwards)])),
            laws=laws(),
            hand=name,
        )
        for name, side in (("left", -1.0), ("right", 1.0))
    ]


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (32.0, -6.0, 24.0), (0.0, 0.0, HEIGHT), field_of_view=38.0)
    robots.add_robot(builder, robot(), color=shapes.WARM_ROBOT)
    for trap, color in zip(traps(), (shapes.RED_BEAM, shapes.CYAN_BEAM), strict=True):
        builder.add(trap, color=color, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
