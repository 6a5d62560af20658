"""What every description is held to, read from a file or built in Python. Open `scene` first.

| file | what it holds |
|---|---|
| `scene` | `check_scene`: each part by itself, then what parts say of each other |
| `item` | `check_item`: one of them by itself, before it is written |
| `fields` | values against the vocabulary's rows: types and ranges |
| `numbers` | places, rotations and tracks |
| `parts` | traps, bodies and obstacles |
| `overlap` | bodies that start inside each other or inside an obstacle |
| `period` | space that repeats: its length, and obstacles and a flow that repeat, too |
| `inlet` | an inlet: its domain, and cells that use it |
"""
