"""Drivers: the kernels that are launched. In: a feature set. Out: a kernel, or several, that step a scene.

solo: bodies that cannot touch, one thread per (world, body), many steps per launch; lanes and lanes_rigid are its form
    for CPUs, with noise in blocks, and lanes_alike that of equal worlds in vectors (lane_groups says how many lanes).
world: up to 24 bodies that touch, one thread per world (world_room: the memory of a thread; world_contacts: finding
    and settling contacts; world_moves: how a step ends; coupled_world: with hydrodynamic coupling; world_phases: its
    form for GPUs where bodies turn, a kernel for each stage).
grid: many bodies, one thread per body and step, or a block of threads per world of some hundred.

inlets: cells that have left come in again, in all of these; grid_inlets: in the grid driver.
episodes: which worlds are in motion, which have ended, which start anew; predicates: what commonly ends them.
interfaces: how far worlds have come on their way to a rare event, and who is at an interface.
observations: numbers that are read of worlds in motion, and what of them is kept; numbers: common ones.

Open solo first: it is the shortest that is complete.
"""
