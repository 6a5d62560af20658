"""The live loop, and the session that is built around it.

`session` puts a scene, hands, page and recording together and sums up what the session was like; `live` is its loop.
"""
