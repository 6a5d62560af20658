"""The items of the report, a module each: computed, compared, drawn.

Each has `run`, which is given a `Request` and returns a `Result`; `otwarp.reproduce.registry` lists them. To begin
with, open `force_curves`.

    setup                    the table of parameters
    handle                   the trap and sphere of force curves
    force_curves             eq. 1 and its fits
    tilts                    how a robot lies between two traps, simulated and by the balance of forces
    strategy_a, strategy_b   motion fidelity
    rendering                rendered against model force
    delivery                 trajectories, contact force and distance of the cell delivery
    user_study               simulated operators with and without haptics
    networks_plan, networks  which networks are trained on what; their table
    chain, contract          the signal chain; the topics of the middleware
"""
