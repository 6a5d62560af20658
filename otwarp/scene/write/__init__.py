"""From the description to a USD stage that loads back equal. Open `builder` first.

| file | what it holds |
|---|---|
| `builder` | `SceneBuilder`: one item, one call |
| `pieces` | what it adds in one call: meshes, robots with their traps, cells |
| `mesh_file`, `into` | a mesh read, repaired and checked; added to the file of a scene |
| `edit` | `StageEditor`: a file's scene with things added, moved, deleted, undone; saved as another file |
| `attributes` | `ot:` attributes by the vocabulary's rows |
| `obstacles`, `poses` | colliders; transform ops |
| `export`, `body_file` | layers written whole or not at all; one body as a file of its own |
"""
