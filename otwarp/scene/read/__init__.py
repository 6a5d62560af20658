"""From a USD stage to the fields of a `Scene`, every refusal one line. Open `load` first.

    file ──► source (opened stage, units, transforms) ──► load (sorts the prims) ──► one reader for each kind

| file | what it holds |
|---|---|
| `load` | `read_file`, `read_stage`: one pass that sorts the prims, then a reader for each |
| `typed` | the one way in for values of USD attributes: there, and of the type that the schema says |
| `crate`, `read_through` | binary files, first read by a process that may crash |
| `diagnostics` | what USD finds wrong by itself, in one line |
| `source` | an open stage; stage units → µm, time codes → s |
| `attributes` | `ot:` attributes by the vocabulary's rows: names, types, ranges |
| `bodies`, `traps`, `obstacles`, `environment` | the readers |
| `flow_file`, `vtk_file` | velocity fields on a grid, of NumPy, netCDF and VTK |
| `motion` | time samples → keys between which straight lines will do |
| `lenses` | cameras that can show something |
| `variations` | scenes that differ from a file in some attributes |
| `remarks` | what the file says without effect |
| `validate` | all that can be said of a file before it runs |
"""
