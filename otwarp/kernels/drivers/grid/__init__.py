"""The grid driver: many bodies that may touch. In: a feature set. Out: the kernels of a step, or one of many steps.

Open `step` first: what one thread per body and launch does, one kernel after the other. `world` does the same to worlds
of some hundred bodies by a block of threads each, for many steps in one launch; `phases` does it part by part for all
worlds, where they are many for a GPU.

data, store    the arrays they keep between launches, and contacts in them
move           free moves of the integrator's two stages
neighbours     who is near whom, from cells (`cells`); on CPUs slots by vectors (`slot_lists`)
reach          what a step may bring to touch
lists          the contacts of each body in a step
contacts       their forces in sweeps over all at once; on CPUs one after the other (`turns`)
entries        contacts of a world that a team of threads (`teams`) shares out; which are solved (`entry_search`), and
               sweeps over them (`entry_sweeps`) by the law of `entry_law`
soft           the whole step where contacts are soft: forces as they are at its start (`soft_forces`), on CPUs summed
               pair by pair (`pushes`)
inlets         cells that have left come in again
"""
