"""Recordings of sessions, and their replay bit for bit.

`file` is the format: topics, messages, force laws; `writer` fills it beside the live loop; `replay` runs the haptic
chains of a recording again and compares their forces.
"""
