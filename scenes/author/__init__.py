"""The scripts that made the shipped stages: each module has `build() -> SceneBuilder`."""
