"""What a picture needs of a stage, as NumPy arrays in µm: shapes, looks, lights and camera. Open `draw_list` first.

stage ──► walk (what is visible) ──► shapes, looks, view ──► drawables (one picture), parts (by owning prim)

`files` finds the stage of a scene or of a recorded run; `unlike` says what a file does not show as a scene has it.
"""
