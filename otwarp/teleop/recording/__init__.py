"""Recordings of sessions, and their replay bit for bit.

`file` is the format: topics, messages, force laws; `markers` what is drawn of a scene, `schemas` what its JSON looks
like; `writer` fills it beside the live loop; `replay` runs the haptic chains of a recording again and compares their
forces.
"""
