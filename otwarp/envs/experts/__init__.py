"""Scripted policies: they see what a learner sees, in µm, and return actions; what trained ones are measured by.
Open `policies` first.

policies        random actions, and what all scripts share
navigate        straight to the goal; the shortest way on a grid
push            round a cell, and then against it
servo           powers and spacings that follow what is seen
delivery        two hands along a path
strides         the same by strides, as the paper's companion acts
operator        a simulated operator, and a policy that shares control with him
"""
