"""`otwarp bench forces`: error against run time of every force model, for one bead in one trap.

`measure` (open it first) runs it and gives a `result`, in memory and as JSON, which `figure` draws and `table` prints.
"""
