"""A scene or a recorded run for programs that want another form of it. Open `stage` first.

| file | what it holds |
|---|---|
| `stage` | one flattened USD file: in metres, or with meshes in place of spheres, cylinders … |
| `meshes` | canonical solids as triangles with normals |
| `gltf` | a stage → a glTF file (`.glb`): nodes that move, materials, camera |
| `nodes` | a prim at several times → position, rotation and scale of a node |
| `glb` | the container: arrays, their accessors, and the file |
"""
