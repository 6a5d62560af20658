"""The shipped tasks, each in a file of its own: a scene, its terms, and a scripted expert.

navigate    one robot past obstacles at rest and in motion
"""
