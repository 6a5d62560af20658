"""`otwarp bench stability`: what happens to scenes that are hard to step.

In: which grids. Out: one letter per cell. `measure` (open it first) runs the cells of `grids`, each of which gets a
`verdict` by closed forms; `table` prints them.

    mechanical      cells without noise: known loads, trap jumps, drag, overlap at the start
    thermal         cells with noise: equipartition of a bead, of a robot, of a bead on a floor
    gaps, curved    hard spheres with noise: in pairs and boxes, and on what is curved
    moving          what varies within a step: bodies that turn fast, commands with fine samples
    laws            escapes with the step that otwarp chooses
    random_scenes   scenes drawn at random, and what must hold in any
    hard_spheres    where these are by Boltzmann's distribution
"""
