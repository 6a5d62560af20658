"""Four equal beads, 12 µm apart, each held by one beam whose force follows one of the four models.

Polystyrene of radius 1 µm (index 1.59) at NA 1.2, 1.064 µm, circular polarization, 1 mW. The constants of the first two
are what `otwarp forces --radius 1 --index 1.59 --na 1.2 --curves` (or `--fit piecewise`) prints; the other two need
none. A computed beam reaches its neighbours, a fitted law does not.
"""

from __future__ import annotations

from otwarp.laws import TrapLaw
from otwarp.scene import SceneBuilder, Settings, Track, Trap
from scenes.author import shapes, trap_laws

RADIUS = 1.0
POWER = 1.0  # [mW]
HEIGHT, SPACING = 10.0, 12.0
REACH = 3.0
"""Cutoff of the harmonic law [µm]: without one a spring would pull the other beads, too."""
DURATION = 1.0

HARMONIC = {
    "radial": TrapLaw(stiffness=trap_laws.BEAD_STIFFNESS_RADIAL, cutoff=REACH, power=1.0),
    "axial": TrapLaw(stiffness=trap_laws.BEAD_STIFFNESS_AXIAL, cutoff=REACH, power=1.0),
}
PIECEWISE = {
    "radial": trap_laws.continuous_law(1.7825, 1.132, 1.566, radius=RADIUS),
    "axial": trap_laws.continuous_law(0.38923, 1.362, 2.62, radius=RADIUS),
}
MODELS = {"harmonic": HARMONIC, "piecewise": PIECEWISE, "table": {}, "exact": {}}


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -44.0, HEIGHT + 16.0), (0.0, 0.0, HEIGHT), field_of_view=50.0)
    for i, (model, laws) in enumerate(MODELS.items()):
        x = (i - 1.5) * SPACING
        bead = shapes.bead(f"/World/{model}_bead", (x, 0.0, HEIGHT), radius=RADIUS)
        trap = Trap(
            prim=f"/World/Traps/{model}",
            position=Track.constant((x, 0.0, round(HEIGHT - trap_laws.BEAD_EQUILIBRIUM, 6))),
            power=Track.constant(POWER),
            numerical_aperture=1.2,
            model=model,
            equilibrium=trap_laws.BEAD_EQUILIBRIUM if laws else 0.0,
            holds=f"/World/{model}_bead/sphere",
            **laws,
        )
        builder.add(bead, color=shapes.WARM_ROBOT)
        builder.add(trap, color=shapes.RED_BEAM, opacity=0.25)
    shapes.observed(builder, focus=HEIGHT)
    return builder
