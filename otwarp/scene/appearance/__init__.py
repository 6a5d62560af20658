"""How things of a scene look: one set of colours, materials and lights for all that authors or draws. Open `missing`.

| file | what it holds |
|---|---|
| `palette` | colours and opacities by kind; robots in turn, so that they can be told apart |
| `materials` | `UsdPreviewSurface` materials, display colours, extents, and the drawn beam of a trap |
| `lights` | a dome and a key light in units that any renderer shows rightly |
| `missing` | a stage → the layer with looks, beams, goal and lights that it does not have |
"""
