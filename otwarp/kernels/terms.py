"""Which terms a step has, and why: what `otwarp info` prints."""

from __future__ import annotations

from otwarp.kernels.core.features import GRID_WORLD_BODIES, MAX_WORLD_BODIES, Features
from otwarp.kernels.forces.force import Term
from otwarp.kernels.forces.table import FORCES, active_forces


def terms(f: Features) -> list[tuple[str, bool, str]]:
    """(term, compiled in, why) for every optional term; first those of forces with several models."""
    rows = [*FORCES.values(), *(row for row in active_forces(f) if row not in FORCES.values())]
    forces = [(r.name, r.active(f), r.why(f), r.why_not) for r in rows if r.listed is None]
    models = [term for r in rows if r.listed is not None for term in r.listed(f)]
    yes_no: tuple[Term, ...] = (
        *models,
        ("moving traps", f.moving_traps, "traps have time samples", "no trap has time samples"),
        ("traps with velocities", f.gliding_traps, "Simulation(glides=True)", "commands are places"),
        ("trap speed limit", f.speed_limits, "a trap has a finite limit", "no trap has a finite limit"),
        ("rotation, 6×6 mobility", f.rigid, "a body has several spheres", "all bodies are lone spheres"),
        ("lone-sphere mobility", f.spheres, "a body is a lone sphere", "no body is a lone sphere"),
        ("Brownian noise", f.brownian, "ot:scene:brownian and temperature > 0", "switched off or 0 K"),
        *forces,
        ("flow", f.flow is not None, f"{f.flow} flow", "no OtFlowAPI, or its flow is zero"),
        (
            "obstacle contact",
            bool(f.obstacles),
            "shapes: " + ", ".join(f.obstacles),
            "no obstacle, or nothing that collides",
        ),
        (
            "hydrodynamic walls",
            f.walls > 0,
            "planes with ot:obstacle:hydrodynamic",
            "no plane with ot:obstacle:hydrodynamic",
        ),
        (
            "hydrodynamic coupling",
            f.coupling,
            "ot:scene:hydrodynamicCoupling, and two or more bodies",
            "ot:scene:hydrodynamicCoupling is false, or there is one body",
        ),
        ("periodic axes", f.periodic, "ot:scene:period", "ot:scene:period is 0 along all axes"),
        ("inlet", f.inlet, "ot:scene:domainLow and domainHigh", "the domain has no end"),
        ("moving obstacles", f.moving_obstacles, "an obstacle has time samples", "all obstacles are at rest"),
        *_contact_terms(f),
        ("worlds that end", f.episodes, "Simulation(ends=…)", "Simulation without ends"),
        (
            "escape detection",
            f.escapes,
            "traps have a finite reach",
            "no trap with a finite reach holds a sphere",
        ),
    )
    return [(name, on, yes if on else no) for name, on, yes, no in yes_no]


def _contact_terms(f: Features) -> tuple[Term, ...]:
    """What contacts are, and how their forces are found."""
    return (
        ("body–body contact", f.pairs, "two or more bodies collide", "fewer than two bodies collide"),
        ("rods in contact", f.rods, "a rod collides", "no rod that anything can touch"),
        (
            "neighbour lists",
            f.driver == "grid" and f.pairs,
            f"more than {MAX_WORLD_BODIES} bodies, and they may touch",
            "bodies do not touch" if not f.pairs else "few bodies",
        ),
        (
            "a block of threads per world",
            f.by_world,
            f"up to {GRID_WORLD_BODIES} bodies, and contacts may be stiff",
            "another driver, many more bodies, or soft contacts",
        ),
        (
            "implicit contact forces",
            f.contacts and not f.soft_contacts,
            "contacts may be stiff against the time step",
            "contacts are soft against the time step" if f.contacts else "nothing touches",
        ),
        (
            "contacts solved for moves",
            f.body_space,
            "some contacts are soft",
            "contacts are stiff, bodies coupled or near walls, or there are many",
        ),
    )
