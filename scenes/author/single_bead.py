"""One bead of radius 1 µm at rest in one harmonic trap of 1 mW.

The stiffness is the exact one of a polystyrene bead (index 1.59, NA 1.2, 1.064 µm) from `trap_laws.py`.
"""

from __future__ import annotations

from otwarp.laws import TrapLaw
from otwarp.scene import SceneBuilder, Settings, Track, Trap
from scenes.author import shapes, trap_laws

RADIUS = 1.0
POWER = 1.0  # [mW]
HEIGHT = 10.0
DURATION = 1.0


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -14.0, HEIGHT + 6.0), (0.0, 0.0, HEIGHT), field_of_view=36.0)
    bead = shapes.bead("/World/bead", (0.0, 0.0, HEIGHT), radius=RADIUS)
    trap = Trap(
        prim="/World/Traps/trap",
        position=Track.constant((0.0, 0.0, round(HEIGHT - trap_laws.BEAD_EQUILIBRIUM, 6))),
        power=Track.constant(POWER),
        numerical_aperture=1.2,
        model="harmonic",
        radial=TrapLaw(stiffness=trap_laws.BEAD_STIFFNESS_RADIAL, power=1.0),
        axial=TrapLaw(stiffness=trap_laws.BEAD_STIFFNESS_AXIAL, power=1.0),
        equilibrium=trap_laws.BEAD_EQUILIBRIUM,
        holds="/World/bead/sphere",
    )
    builder.add(bead, color=shapes.WARM_ROBOT)
    builder.add(trap, color=shapes.RED_BEAM, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
