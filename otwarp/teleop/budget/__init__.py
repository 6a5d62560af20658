"""The reduced scene: what this machine carries in time with the clock.

`reduce` decides, by what `report` measures (`measure_scene`) and what `reach` says of the traps; `report` also says to
the user what was left out.
"""
