"""`otwarp bench terms`: what every term of the step costs, on and off.

`measure` (open it first) times pairs of `scenes` that differ by one term; `table` prints them.
"""
