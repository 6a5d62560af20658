"""Authors USD stages: `builder.SceneBuilder`."""
