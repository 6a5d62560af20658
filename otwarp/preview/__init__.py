"""Headless pictures and movies of a stage or a recorded run: a small ray caster on Warp."""
