"""Physics on the device: small `wp.func` terms, the structs they read, and the factory that fuses them into a step.

Imports neither `pxr` nor `torch` nor a viewer.
"""
