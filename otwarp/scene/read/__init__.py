"""Reads a USD stage into the description: `load.load_scene`."""
