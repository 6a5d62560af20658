"""The ray caster on the device: nothing here knows of USD or files. Open `raycast` first.

Lengths are µm from the point that the camera looks at, so that float32 is precise wherever the scene lies. Rays have
unit directions, so that a ray parameter is a distance [µm]; colours are linear RGB.

- `raycast`: one thread per pixel, layers composited front to back.
- `shading`: the colour of a surface point.
- `tracing`: the scene on the device, the nearest surface along a ray, and how much light passes along one.
- `intersect`: where a ray enters each canonical solid.
"""
