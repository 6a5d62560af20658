"""What of environments runs on the device: actions, resets, observations, rewards, ends. Float32; open `judge` first.

types      the structs of the other files
geometry   where spheres, traps and obstacles are
control    actions to traps
starts     worlds that start anew
rows       rows of tables, copied, and rows of numbers that are written at once
terms      what observations, rewards and ends are made of, as plain functions of a world at the end of a period
specialise terms for the shapes of a scene's obstacles
task_terms what the shipped tasks have beside these
judge      one kernel for all terms of a task
observe    one that looks at worlds which something else steps
"""
