"""A scene's description and a user's numbers, as the arrays that kernels read.

In: a `Scene`, parameters by name (`parameters`, open it first; `arguments` holds numbers to what they must be,
`capacity` worlds to the memory that there is), forces (`forces`). Out: the structs of `kernels.core.types` on a device,
in the precision of a model (`arrays`). `bodies`, `traps`, `walls`, `coupling`, `flow`, `period`, `inlets` and `worlds`
pack what their names say; `commands` makes of samples that are finer than the step what its stages see; `optics`
computes the force tables, one for all traps whose beams and spheres are equal.
"""
