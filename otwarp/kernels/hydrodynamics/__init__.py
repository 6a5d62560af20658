"""What the liquid adds: planes that hinder motion, and bodies that carry each other along.

walls (open this first) and walls_rigid replace the dynamics of free bodies near no-slip planes; coupling is the
far-field mobility of several bodies.
"""
