"""`otwarp bench me`: what a user's scenes cost on his machine, one run and a thousand.

`measure` (open it first) steps them in one world and in many; `table` and `figure` show what was found.
"""
