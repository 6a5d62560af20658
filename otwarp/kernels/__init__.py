"""Kernels: physics as Warp functions, composed into the one step that a scene needs.

In: `Features` and structs of arrays. Out: `step.make_step(features)`, the only entry that other rooms launch from (open
`step` first); `terms` says which terms a step has, and why. The inner rooms, each of which imports only those above it:

    core           structs, features, random numbers, rotation, precision
    cpu            vector blocks of a CPU
    optics         traps, tables, exact forces, escapes
    body_forces    forces with parameters per body: built-in ones, and what a user's is
    forces         `FORCES`, all forces as rows of one table, and their sum
    bodies         spheres and rigid bodies in a flow
    hydrodynamics  walls and coupling
    contact        who touches, and what keeps them apart
    integrate      schemes over any body
    drivers        solo, world, grid

`float64` is made from them on import (`core.precision`).
"""
