"""What limits the time step of a scene, and the step that follows from it and the wanted accuracy.

In: a `Scene` and what `packing` found of it. Out: `TimeScales`, of which `timescales` (open it first) makes the step.

    observables    what the step may make wrong: an estimated error and a longest step for each, open to new rows
    relaxation     in the traps: which trap acts on which sphere, and the rate that follows from its power
    rotors         how thermal rotation within a step falsifies orientations and displacements of rigid bodies
    sampling       samples of traps and obstacles that are finer than the step
    contact_errors  gaps in contact: whether bodies come to touch, and what the step does to them
    edges          where beads leave the traps, as far as they come there
    coupled_rates  faster still, where bodies carry each other along
    speeds         of what neither traps nor noise move: flow, obstacles, weight, adhesion
    steady_loads   of the forces of `FORCES`, traps apart; the teleop budget and walls ask it, too
    force_probe    of forces that state no bounds, as measured
    softness       whether all contacts are so soft against the step that explicit forces serve
"""
