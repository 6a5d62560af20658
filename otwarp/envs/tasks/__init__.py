"""The shipped tasks, each in a file of its own: a shipped scene, what is seen, earned and wanted, a scripted expert.
Open `navigate` first.

navigate        one robot past pillars and swinging boxes
push            a cell that nothing holds, pushed to a goal
hold            a robot kept in a stream with as little power as will do
orient          a pair of spheres, tilted by how far its traps stand apart
cell_delivery   two robots squeeze a cell and carry it to a goal
ot_gym          the same with the spaces of the paper's companion: a stride along a path
terms           what only these tasks see, earn and end by
ot_gym_env      its environments
"""
