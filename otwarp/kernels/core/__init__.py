"""What every kernel is written with.

In: nothing of the other rooms. Out:

    types (open it first), table_data, exact_data   the structs that kernels read and write
    step_constants                                  what a step needs to know of one body, made once for many steps
    packed                                          a point with the number that belongs to it
    contiguous                                      elements of arrays without strides
    features, dynamics                              what a scene needs; what an integrator is composed from
    medium, noise, random, rotation, roots          arithmetic of the liquid, of thermal noise, of turns
    keyframes, worlds, team                         samples in time; worlds with clocks of their own; who steps one
    cells, periodic, recycling                      space: neighbours, what repeats, inlets and outlets
    faults, reads, rounding                         what went wrong, reading past caches, how finely numbers round
    functions, precision                            functions from outside and from text; float64 kernels from float32
"""
