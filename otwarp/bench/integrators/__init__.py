"""`otwarp bench integrators`: error against run time of integrators, force models and precisions.

`measure` (open it first) runs it and gives a `result`, in memory and as JSON, which `figure` draws and `table` prints.

    cases         what is compared
    wells         where: two traps, and what is true of a bead in them by `fokker_planck`
    observables   what is measured, with standard errors
    largest_step  the largest step of a wanted error, from noisy errors at a few
"""
