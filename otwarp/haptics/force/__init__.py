"""The local model: the optical force on the spheres near an operator's traps, in plain floats.

law      curves of eq. 1, and `LocalModel`, the sum of eq. 2 over traps and spheres
table    a force table as the servo reads it
"""
