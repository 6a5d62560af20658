"""What differs from episode to episode: in worlds of one model, and between models.

In: the axes of `Task.randomise`. Out: a table on the device of which each episode takes a row, and tasks whose scenes
differ in what a model fixes. Open `variants` first.

groups    tasks whose scenes differ in attributes of the stage or speeds of paths
variants  the table of parameters and starts
rows      its rows, copied into worlds that start anew
"""
