"""What a user measures on his own machine: a room for each `otwarp bench` command, and what they share.

In comes what was typed, as arguments of a room's `measure.bench_…`; out comes its findings, which `save` writes as JSON
and which the room's `table` and `figure` turn into what is shown.

    me           what scenes cost here: a step, a run, a thousand runs
    forces       error against run time of every force model
    integrators  error against run time of integrators, force models and precisions: `wells` to measure in,
                 `observables` with standard errors, `fokker_planck` for what is true, `largest_step` for 1 %
    speed        steps per second of the `workloads`, in turns with `peers` in other languages
    stability    `grids` of stress tests: cells with noise in `thermal`, without in `mechanical`, drawn in
                 `random_scenes`; each gets a `verdict`
    terms        what every term of the step costs: pairs of `scenes` that differ by one

All of them time by `timing` (interleaved pairs, medians and quartiles), say where by `machine`, keep what they found in
`findings` and print tables of `report`; `picture` is the look of their figures. `rungs` has a trapped bead and the
ladder of force models, `timed_rung` steps it, `radial_wells` says what it does; `closed_forms` are those of contact,
springs and floors; `scenes` has small scenes with closed forms. Open `speed/measure.py` first.

Scripts of the repository's `benchmarks/` use these rooms, and `commit`, to say whose figures are; nothing here knows of
them.
"""
